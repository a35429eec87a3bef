"""Radios with signals for tests: IEEE 802.15.4 and IEEE 802.11 without anything that varies."""

from dataclasses import replace

from swarmwire.comms.radio.config.impairments import BearingMeasure, Bursts, Measures, RangeMeasure, RssiMeasure
from swarmwire.comms.radio.config.path_loss_models import LogDistance
from swarmwire.comms.radio.config.phy import Access, Fading, Noise, Reception, Shadowing
from swarmwire.comms.radio.config.radio import Radio

# As in ns-3: 5 MHz of noise, path loss 46.6777 dB at 1 m and exponent 3.
IEEE_802_15_4 = Radio(
    model="log-distance",
    log_distance=LogDistance(3.0, 46.6777),
    noise=Noise(5e6, 0.0),
    overhead_bytes=17,
    max_payload_bytes=110,
    send_offset="tick",
)
WIFI_B = replace(
    IEEE_802_15_4,
    frame="802.11b",
    bit_rate_bps=1_000_000,
    overhead_bytes=36,
    noise=Noise(22e6, 7.0),
    reception=Reception("802.11b", preamble_sinr_db=4.0, capture_window_s=4e-6),
)
ALL_GIVEN = Measures(RangeMeasure(0.1), BearingMeasure(0.1), RssiMeasure(0.5))
METHODS = ("none", "aloha", "csma-802154", "dcf")


def with_access(method: str, radio: Radio = IEEE_802_15_4) -> Radio:
    """A radio with this method; of IEEE 802.11 for dcf."""
    return replace(WIFI_B if method == "dcf" else radio, access=Access(method))


def drawing(method: str) -> Radio:
    """A radio with this method and everything that draws."""
    return replace(
        with_access(method),
        send_offset="uniform",
        loss=0.1,
        jitter_s=0.05,
        shadowing=Shadowing(),
        fading=Fading(),
        bursts=Bursts(0.2, 0.4),
        measures=ALL_GIVEN,
    )
