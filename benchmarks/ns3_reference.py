"""What ns-3 3.44 gave, recorded once, and the presets as it was run."""

import json
from pathlib import Path
from typing import Any

from swarmwire.comms.radio.config.radio import Radio
from swarmwire.deploy.scenario_parts import radio_of

REFERENCE = Path(__file__).parents[1] / "tests" / "support" / "comms" / "reference"
PRESETS = {"802.15.4": "ieee802154", "802.11a 6 Mbit/s": "wifi-a-6M", "802.11b 1 Mbit/s": "wifi-b-1M"}
AS_RUN = {  # ns-3 was run without IP and UDP headers, and its 802.15.4 queue has no end
    "ieee802154": ["radio.queue_limit=1000000"],
    "wifi-a-6M": ["radio.overhead_bytes=36", "radio.reception.model=802.11ag-nist"],
    "wifi-b-1M": ["radio.overhead_bytes=36"],
}
FAR = ["radio.log_distance.reference_loss_db=46.6777"]  # where nodes stand apart
FAR_154 = ["radio.noise.bandwidth_hz=5e6", "radio.noise.figure_db=0", "radio.reception.sensitivity_dbm=-106.58"]


def recorded(name: str) -> dict[str, Any]:
    """One file of the reference: what was run, and `rows`."""
    return json.loads((REFERENCE / name).read_text(encoding="utf-8"))


def radio_in_one_spot(technology: str) -> Radio:
    """The preset where distance does not count."""
    preset = PRESETS[technology]
    return radio_of(preset, AS_RUN[preset])


def radio_far_apart(technology: str) -> Radio:
    """The preset with ns-3's path loss and, of 802.15.4, its noise and sensitivity."""
    preset = PRESETS[technology]
    own = FAR_154 if preset == "ieee802154" else []
    return radio_of(preset, [*AS_RUN[preset], *FAR, *own])
