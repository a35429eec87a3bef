"""The scenario table `[radio]` and its checks, and the airtime of frames of a radio.

No kernels here: a scenario is read without a compiler.
"""

from dataclasses import dataclass, field, replace
from ipaddress import IPv4Network

import numpy as np

from swarmwire.comms.base.arrays import IntArray
from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.ethernet import HEADER_BYTES
from swarmwire.comms.radio.config.impairments import Bursts, Delays, Measures, refuse_negative
from swarmwire.comms.radio.config.path_loss_models import Friis, ItuIndoor, LogDistance, TwoRay
from swarmwire.comms.radio.config.phy import (
    Access,
    Antenna,
    Bodies,
    Fading,
    ReceiverNoise,
    Reception,
    Shadowing,
    Walls,
    refuse_unfit,
)
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.timing import (
    DSSS_RATES_BPS,
    OFDM_BITS_PER_SYMBOL,
    OFDM_MANDATORY_BPS,
    at_bit_rate_ns,
    ieee80211a_ns,
    ieee80211b_ns,
    ieee80211g_ns,
)


@dataclass(frozen=True)
class Trace:
    """Measured links that are replayed: a value holds until the next of its link (sender and receiver)."""

    file: str = parameter(
        help="CSV or Parquet beside the scenario: t_s, tx, rx, and delivery_ratio, rssi_dbm or delay_s, or several"
    )
    others: str = parameter(
        "none",
        help="what links without a value yet are: none, out of range; or as the model has them",
        choices=("none", "model"),
    )


@dataclass(frozen=True)
class Interface:
    """A network interface on each robot, for programs: its frames are packets of this radio. Needs real time."""

    network: str = parameter("10.77.0.0/16", help="IPv4 network of which the robots get the first addresses, in order")


DATAGRAM_BYTES = 28  # headers of IPv4 and UDP
MIN_MTU_BYTES = 68  # of IPv4 (RFC 791)
MODELS = ("unit-disk", "log-distance", "friis", "two-ray", "itu-indoor")
FRAMES = ("plain", "802.11a", "802.11b", "802.11g")


@dataclass(frozen=True)
class Radio:
    """The radio: either reaches to a fixed distance (unit disk), or sends signals that fade with distance."""

    range_m: float | None = parameter(
        None,
        help="no packet reaches receivers farther than this, centre to centre, but over measured links; disks need it",
        unit="m",
        above=0,
    )
    model: str = parameter("unit-disk", help="how the signal fades with distance", choices=MODELS)
    preset: str | None = parameter(
        None, help="a kind of radio, whose values count where the scenario gives none", choices=tuple(PRESETS)
    )
    line_of_sight: bool | None = parameter(
        None, help="obstacles block the signal; without it true for the unit disk, false for signals"
    )
    bodies_block: bool = parameter(False, help="of the unit disk: robots in between block the signal, as obstacles do")
    loss: float = parameter(
        0.0, help="probability that a packet within reach is lost, for each receiver", at_least=0, at_most=1
    )
    latency_s: float = parameter(
        0.0, help="delay of every packet beyond its airtime", unit="s", at_least=0, at_most=3600
    )
    jitter_s: float = parameter(
        0.0, help="further delay, uniform from 0 to this, for each receiver", unit="s", at_least=0, at_most=3600
    )
    bit_rate_bps: int = parameter(250_000, help="bits on air per second", unit="bit/s", at_least=1, at_most=10**12)
    frame: str = parameter(
        "plain",
        help="airtime of a packet: its bits at the bit rate, or that of a standard, with its preamble",
        choices=FRAMES,
    )
    overhead_bytes: int = parameter(
        0, help="bytes on air beyond the payload (headers, plain: preamble)", unit="byte", at_least=0, at_most=65535
    )
    max_payload_bytes: int = parameter(
        100, help="a larger payload is refused by the radio", unit="byte", at_least=2, at_most=65535
    )
    queue_limit: int = parameter(
        20, help="packets that may wait at a sender for its radio to become free", at_least=0, at_most=10**6
    )
    queue_lifetime_s: float | None = parameter(
        None,
        help="with a PHY: a packet that has waited longer at its sender is dropped when its turn comes, as from a full "
        "queue; without it none is",
        unit="s",
        above=0,
        at_most=3600,
    )
    send_offset: str | float = parameter(
        "uniform",
        help='when in its tick a robot sends: "uniform" (keyed phase, jitter), "tick" (its start), or an offset in s',
    )
    min_delivery: float = parameter(
        0.1,
        help="an edge of the radio graph: a lone packet gets through both ways with this probability",
        at_least=0,
        at_most=1,
    )
    cut_off_db: float = parameter(
        15.0,
        help="with a PHY: a robot with a mean strength so far below noise and sensitivity neither receives nor "
        "interferes; "
        "less is faster",
        unit="dB",
        at_least=0,
        at_most=60,
    )
    propagation_mps: float | None = parameter(
        None,
        help="speed of the wave, for sound and the like: packets are received later with distance, though they are on "
        "air everywhere at once, and fading goes by this wave's length; without it that of light, and no delay",
        unit="m/s",
        at_least=1,
        at_most=3e8,
    )
    frequency_hz: float = parameter(2.44e9, help="with a PHY: the carrier", unit="Hz", at_least=1e3, at_most=1e12)
    log_distance: LogDistance | None = parameter(None, help="of the model log-distance")
    two_ray: TwoRay | None = parameter(None, help="of the model two-ray")
    itu_indoor: ItuIndoor | None = parameter(None, help="of the model itu-indoor")
    antenna: Antenna | None = parameter(None, help="with a PHY: power and gain")
    shadowing: Shadowing | None = parameter(None, help="with a PHY: what is not modelled varies from place to place")
    walls: Walls | None = parameter(None, help="with a PHY: obstacles weaken, where they do not block")
    bodies: Bodies | None = parameter(None, help="with a PHY: robots in between weaken")
    fading: Fading | None = parameter(None, help="with a PHY: power varies over fractions of a wavelength")
    noise: ReceiverNoise | None = parameter(None, help="with a PHY: the receiver's own noise")
    reception: Reception | None = parameter(None, help="with a PHY: when a frame is right")
    access: Access | None = parameter(None, help="with a PHY: who may send when, and whether frames collide")
    bursts: Bursts | None = parameter(None, help="links are bad for a while, and good again")
    trace: Trace | None = parameter(None, help="measured links are replayed")
    delays: Delays | None = parameter(None, help="a further delay, for each receiver")
    measures: Measures = field(default_factory=Measures)
    interface: Interface | None = parameter(None, help="robots have a network interface, for programs; in real time")

    @property
    def frame_headers_bytes(self) -> int:
        """Bytes of a frame of an interface that stand in `overhead_bytes` already.

        IEEE 802.11 has headers of its own in place of Ethernet's, and `overhead_bytes` holds IPv4's and UDP's of
        messages, which a frame brings along. Other radios carry the whole frame.
        """
        return 0 if self.frame == "plain" else HEADER_BYTES + DATAGRAM_BYTES

    @property
    def mtu_bytes(self) -> int:
        """The largest IP packet in a frame of an interface."""
        return self.max_payload_bytes + self.frame_headers_bytes - HEADER_BYTES

    @property
    def is_phy(self) -> bool:
        """Whether it has a PHY: signals with a strength."""
        return self.model != "unit-disk"

    @property
    def acknowledges(self) -> bool:
        """Whether senders get a transmit status for each unicast packet."""
        return self.is_phy and self.access_or_default.acknowledges

    @property
    def needs(self) -> tuple[str, ...]:
        """The needs of agents that it meets, by the names that they declare."""
        return (*self.measures.needs, "radio.tx_status") if self.acknowledges else self.measures.needs

    @property
    def needs_line_of_sight(self) -> bool:
        """Whether obstacles block."""
        return not self.is_phy if self.line_of_sight is None else self.line_of_sight

    @property
    def loss_model(self) -> LogDistance | Friis | TwoRay | ItuIndoor:
        """The path loss model; ValueError for the unit disk."""
        if self.model == "log-distance":
            return self.log_distance or LogDistance()
        if self.model == "two-ray":
            return self.two_ray or TwoRay()
        if self.model == "itu-indoor":
            return self.itu_indoor or ItuIndoor()
        if self.model == "friis":
            return Friis()
        raise ValueError("model: a unit disk has no path loss")

    @property
    def antenna_or_default(self) -> Antenna:
        """The antenna, standard values where nothing was given."""
        return self.antenna or Antenna()

    @property
    def noise_or_default(self) -> ReceiverNoise:
        """The noise, standard values where nothing was given."""
        return self.noise or ReceiverNoise()

    @property
    def reception_or_default(self) -> Reception:
        """The reception, standard values where nothing was given."""
        return self.reception or Reception()

    @property
    def access_or_default(self) -> Access:
        """The access, standard values where nothing was given."""
        return self.access or Access()


# Octets of an acknowledgement: preamble, delimiter, length and PSDU of IEEE 802.15.4; the PSDU of IEEE 802.11.
SHORT_ACKNOWLEDGEMENT, LONG_ACKNOWLEDGEMENT = 11, 14


def airtime_ns(radio: Radio, frame_bytes: IntArray) -> IntArray:
    """How long frames of so many bytes, overhead included, occupy the medium, in ns, (k,)."""
    if radio.frame == "802.11b":
        return ieee80211b_ns(frame_bytes, radio.bit_rate_bps, short_preamble=False)
    if radio.frame == "802.11a":
        return ieee80211a_ns(frame_bytes, radio.bit_rate_bps)
    if radio.frame == "802.11g":
        return ieee80211g_ns(frame_bytes, radio.bit_rate_bps)
    return at_bit_rate_ns(frame_bytes, radio.bit_rate_bps)


def acknowledgement_bytes(radio: Radio) -> int:
    """The size of an acknowledgement."""
    return SHORT_ACKNOWLEDGEMENT if radio.frame == "plain" else LONG_ACKNOWLEDGEMENT


def acknowledgement_rate_bps(radio: Radio) -> int:
    """The bit rate of acknowledgements: OFDM's highest mandatory one up to that of the frame (802.11-2007, 9.6)."""
    if radio.frame in ("802.11a", "802.11g"):
        return max(rate_bps for rate_bps in OFDM_MANDATORY_BPS if rate_bps <= radio.bit_rate_bps)
    return radio.bit_rate_bps


def acknowledgement_ns(radio: Radio) -> int:
    """How long an acknowledgement occupies the medium, in ns."""
    radio = replace(radio, bit_rate_bps=acknowledgement_rate_bps(radio))
    return int(airtime_ns(radio, np.array([acknowledgement_bytes(radio)]))[0])


def eifs_acknowledgement_ns(radio: Radio) -> int:
    """The acknowledgement that EIFS leaves room for, in ns: at the lowest mandatory bit rate, that of 802.11b for g."""
    if radio.frame == "802.11a":
        return int(ieee80211a_ns(LONG_ACKNOWLEDGEMENT, OFDM_MANDATORY_BPS[0]))
    return int(ieee80211b_ns(LONG_ACKNOWLEDGEMENT, DSSS_RATES_BPS[0], short_preamble=False))


# Checks that need more than one key: errors name the key that contradicts another.


PHY_KEYS = ("antenna", "shadowing", "walls", "bodies", "fading", "noise", "reception", "access")
MODEL_KEYS = {"log_distance": "log-distance", "two_ray": "two-ray", "itu_indoor": "itu-indoor"}
OFDM_MODELS = ("802.11ag", "802.11ag-nist")
RECEPTIONS = {"802.11a": OFDM_MODELS, "802.11b": ("802.11b",), "802.11g": OFDM_MODELS}  # beside threshold and table
RATES_BPS = {
    "802.11a": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11b": DSSS_RATES_BPS,
    "802.11g": tuple(OFDM_BITS_PER_SYMBOL),
}


def check_radio(radio: Radio, where: str) -> None:
    """Raise BadInput for the first contradiction in a scenario's [radio]."""
    for name, model in MODEL_KEYS.items():
        if getattr(radio, name) is not None and radio.model != model:
            raise BadInput(where, f"radio.{name}", f'expected model = "{model}" with it, got "{radio.model}"')
    if radio.is_phy:
        _check_phy(radio, where)
    else:
        _check_unit_disk(radio, where)
    if radio.bursts is not None and radio.bursts.loss_bad < radio.bursts.loss_good:
        expected = f"expected at least loss_good, {radio.bursts.loss_good:g}; got {radio.bursts.loss_bad:g}"
        raise BadInput(where, "radio.bursts.loss_bad", expected)
    if radio.delays is not None:
        refuse_negative(radio.delays, where, "radio.delays")
    rates_bps = RATES_BPS.get(radio.frame, (radio.bit_rate_bps,))
    if radio.bit_rate_bps not in rates_bps:
        listed = ", ".join(str(rate_bps) for rate_bps in rates_bps)
        raise BadInput(where, "radio.bit_rate_bps", f"{radio.frame} has {listed}; got {radio.bit_rate_bps} bit/s")
    if radio.is_phy:
        _check_fits(radio, where)
    if radio.interface is not None:
        _check_interface(radio, radio.interface, where)


def _check_interface(radio: Radio, interface: Interface, where: str) -> None:
    try:
        network = IPv4Network(interface.network)
        if network.is_loopback or network.is_multicast:
            raise ValueError(f"{network} is for no hosts")
    except ValueError as error:
        expected = f"expected an IPv4 network such as 10.77.0.0/16: {error}"
        raise BadInput(where, "radio.interface.network", expected) from None
    if radio.mtu_bytes < MIN_MTU_BYTES:
        least = radio.max_payload_bytes + MIN_MTU_BYTES - radio.mtu_bytes
        expected = f"expected at least {least} for an interface: IPv4 needs {MIN_MTU_BYTES} bytes in a frame"
        raise BadInput(where, "radio.max_payload_bytes", f"{expected}; got {radio.max_payload_bytes}")


def unfit_for_torus(radio: Radio) -> str | None:
    """The key by which a radio cannot be that of a torus, if any: only a unit disk knows distances across the seam."""
    return "model" if radio.is_phy else "bodies_block" if radio.bodies_block else None


def _check_unit_disk(radio: Radio, where: str) -> None:
    if radio.range_m is None:
        raise BadInput(
            where, "radio.range_m", "is missing; expected a number above 0 (m), as the model unit disk has one"
        )
    for name in PHY_KEYS:
        if getattr(radio, name) is not None:
            raise BadInput(where, f"radio.{name}", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.measures.rssi is not None:
        raise BadInput(where, "radio.measures.rssi", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.cut_off_db != Radio.cut_off_db:
        raise BadInput(where, "radio.cut_off_db", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.queue_lifetime_s is not None:
        raise BadInput(where, "radio.queue_lifetime_s", "expected a model with a PHY: a unit disk keeps what waits")


def _check_phy(radio: Radio, where: str) -> None:
    refuse_unfit(radio.reception_or_default, radio.bit_rate_bps, where, "radio.reception")
    if radio.bodies_block:
        raise BadInput(where, "radio.bodies_block", "expected the model unit disk with it; a PHY has radio.bodies")
    if radio.walls is not None and radio.needs_line_of_sight:
        raise BadInput(where, "radio.walls", "expected no line_of_sight with it: obstacles either block or weaken")
    if radio.access_or_default.method == "dcf" and radio.frame == "plain":
        raise BadInput(where, "radio.access.method", 'expected a frame of IEEE 802.11 for "dcf", such as 802.11b')
    if radio.access_or_default.method == "csma-802154" and radio.frame != "plain":
        raise BadInput(where, "radio.access.method", f'expected frame = "plain" for "csma-802154", got {radio.frame}')


def _check_fits(radio: Radio, where: str) -> None:
    """Raise BadInput for what the chosen access, reception, frame or fading has no use for."""
    access, reception, fading = radio.access_or_default, radio.reception_or_default, radio.fading
    for name in ("cca_threshold_dbm", "max_retries"):
        if getattr(access, name) is not None and access.method not in ("csma-802154", "dcf"):
            raise BadInput(
                where, f"radio.access.{name}", f'expected method csma-802154 or dcf with it, got "{access.method}"'
            )
    for name in ("cca_sensitivity_dbm", "cca_time_s"):
        if getattr(access, name) is not None and access.method != "dcf":
            raise BadInput(where, f"radio.access.{name}", f'expected method dcf with it, got "{access.method}"')
    fits = ("threshold", "table", *RECEPTIONS.get(radio.frame, (reception.model,)))
    if reception.model not in fits:
        expected = f"expected one of {', '.join(fits)} for frames of {radio.frame}; got {reception.model}"
        raise BadInput(where, "radio.reception.model", expected)
    given = {
        "reception.table": (reception.table is not None, reception.model, "table"),
        "reception.min_sinr_db": (reception.min_sinr_db != Reception.min_sinr_db, reception.model, "threshold"),
    }
    if fading is not None:
        given["fading.k"] = fading.k != Fading.k, fading.distribution, "rician"
        given["fading.m"] = fading.m != Fading.m, fading.distribution, "nakagami"
    for key, (is_given, chosen, needed) in given.items():
        if is_given and chosen != needed:
            raise BadInput(where, f"radio.{key}", f'expected "{needed}" with it, got "{chosen}"')
