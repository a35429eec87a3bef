"""A scenario around a table [radio] that has none of its own, to hold it against every bound and check."""

from collections.abc import Mapping, Sequence
from typing import Any

from swarmwire.comms.radio.config.radio import Radio
from swarmwire.world.scenario_file import scenario_from


def checked_radio(table: Mapping[str, Any], where: str, overrides: Sequence[str] = ()) -> Radio:
    """The radio of a table after overrides such as "radio.loss=0.1"; BadInput as for a scenario."""
    around = {
        "format": 1,
        "name": "a radio",
        "duration_s": 1.0,
        "arena": {"size_m": [2.0, 2.0]},
        "robots": {"nodes": {"body": "epuck", "count": 1, "agent": "none:None"}},
    }
    radio = scenario_from({**around, "radio": table}, where, overrides).radio
    assert radio is not None
    return radio
