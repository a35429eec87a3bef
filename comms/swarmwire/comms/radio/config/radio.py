"""The scenario table `[radio]` and its checks.

No kernels: a scenario is read without a compiler.
"""

from dataclasses import dataclass, field, replace
from ipaddress import IPv4Network

from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.ethernet import HEADER_BYTES
from swarmwire.comms.radio.config.antennas import Antenna, check_pattern
from swarmwire.comms.radio.config.impairments import Bursts, Delays, Measures, refuse_negative
from swarmwire.comms.radio.config.lora import LORA_RECEPTION, Lora, refuse_unfit_lora
from swarmwire.comms.radio.config.path_loss_models import Friis, ItuIndoor, LogDistance, TwoRay
from swarmwire.comms.radio.config.phy import (
    Access,
    Advertising,
    Bodies,
    Fading,
    ReceiverNoise,
    Reception,
    Shadowing,
    Walls,
    refuse_unfit,
)
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.timing import DSSS_RATES_BPS, ESB, ESB_RATES_BPS, HT_BITS_PER_SYMBOL, OFDM_BITS_PER_SYMBOL


@dataclass(frozen=True)
class Trace:
    """Measured links to replay: a value holds until the next value of its link (sender and receiver)."""

    file: str = parameter(
        help="CSV or Parquet, relative to the scenario: t_s, tx, rx, and some of delivery_ratio, rssi_dbm, delay_s"
    )
    others: str = parameter(
        "none",
        help="links that have no value yet: none, out of range; model, as the radio model computes them",
        choices=("none", "model"),
    )


@dataclass(frozen=True)
class Interface:
    """A network interface on each robot, for programs: its frames are packets of this radio. Requires real time."""

    network: str = parameter("10.77.0.0/16", help="IPv4 network whose first addresses the robots get, in order")
    join: dict[str, str] | None = parameter(
        None,
        help="existing network namespaces, by robot or group: netns:NAME, pid:NUMBER or container:NAME, where {index} "
        "and {name} are the robot's; default: a new one for each robot",
    )


DATAGRAM_BYTES = 28  # IPv4 and UDP headers
MIN_MTU_BYTES = 68  # IPv4 (RFC 791)
POSITIONS = ("held", "interpolated")
MODELS = ("unit-disk", "log-distance", "friis", "two-ray", "itu-indoor")
FRAMES = ("plain", "802.11a", "802.11b", "802.11g", "802.11n", "esb", "lora")


@dataclass(frozen=True)
class Radio:
    """The radio: a unit disk of fixed range, or a PHY whose signals weaken with distance."""

    range_m: float | None = parameter(
        None,
        help="greatest distance to receivers, in space, except on measured links; required by the unit disk",
        unit="m",
        above=0,
    )
    model: str = parameter("unit-disk", help="unit disk, or the path loss model of a PHY", choices=MODELS)
    preset: str | None = parameter(None, help="a kind of radio that fills in the keys left out", choices=tuple(PRESETS))
    line_of_sight: bool | None = parameter(
        None, help="obstacles block the signal; default: true for the unit disk, false with a PHY"
    )
    bodies_block: bool = parameter(
        False, help="unit disk only: robots between sender and receiver block the signal, as obstacles do"
    )
    loss: float = parameter(
        0.0, help="probability that a packet is lost, for each receiver in range", at_least=0, at_most=1
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
        help="airtime of a packet: its bits at the bit rate, or that of a standard's frame, preamble included",
        choices=FRAMES,
    )
    overhead_bytes: int = parameter(
        0, help="bytes on air beyond the payload (headers, plain: preamble)", unit="byte", at_least=0, at_most=65535
    )
    max_payload_bytes: int = parameter(
        100, help="the radio drops packets with a larger payload", unit="byte", at_least=2, at_most=65535
    )
    queue_limit: int = parameter(
        20, help="packets that may wait at a sender for its radio to become free", at_least=0, at_most=10**6
    )
    queue_lifetime_s: float | None = parameter(
        None,
        help="PHY only: a packet that waited longer is dropped when its turn comes, as from a full queue; default: no "
        "limit",
        unit="s",
        above=0,
        at_most=3600,
    )
    positions: str = parameter(
        "held", help="where frames find robots: at the start of the tick, or on their way to its end", choices=POSITIONS
    )
    send_offset: str | float = parameter(
        "uniform",
        help='when in its tick a robot sends: "uniform" (keyed phase, jitter), "tick" (its start), or an offset in s',
    )
    min_delivery: float = parameter(
        0.1,
        help="least probability that a lone packet gets through, in both directions, of an edge of the radio graph",
        at_least=0,
        at_most=1,
    )
    cut_off_db: float = parameter(
        15.0,
        help="PHY only: a signal whose mean power is so far below noise and sensitivity is neither received nor "
        "interference; less is faster",
        unit="dB",
        at_least=0,
        at_most=60,
    )
    propagation_mps: float | None = parameter(
        None,
        help="speed of the wave, for sound and the like: receptions are delayed by distance, though packets are on air "
        "everywhere at once, and fading has this wave's length; default: light, without delay",
        unit="m/s",
        at_least=1,
        at_most=3e8,
    )
    frequency_hz: float = parameter(2.44e9, help="PHY only: carrier frequency", unit="Hz", at_least=1e3, at_most=1e12)
    log_distance: LogDistance | None = parameter(None, help="parameters of the model log-distance")
    two_ray: TwoRay | None = parameter(None, help="parameters of the model two-ray")
    itu_indoor: ItuIndoor | None = parameter(None, help="parameters of the model itu-indoor")
    lora: Lora | None = parameter(None, help='frame "lora" only: modulation, duty cycle and dwell time')
    antenna: Antenna | None = parameter(None, help="PHY only: transmit power, gain and pattern of antennas")
    shadowing: Shadowing | None = parameter(None, help="PHY only: loss in the surroundings, which varies with position")
    walls: Walls | None = parameter(None, help="PHY only: loss in obstacles that do not block")
    bodies: Bodies | None = parameter(None, help="PHY only: loss in robots between sender and receiver")
    fading: Fading | None = parameter(None, help="PHY only: power varies over fractions of a wavelength")
    noise: ReceiverNoise | None = parameter(None, help="PHY only: receiver noise")
    reception: Reception | None = parameter(None, help="PHY only: error model of frames")
    access: Access | None = parameter(None, help="PHY only: channel access, and whether frames collide")
    advertising: Advertising | None = parameter(
        None, help="access method advertising only: events, and scans of their receivers"
    )
    bursts: Bursts | None = parameter(None, help="links alternate between a good and a bad state (Gilbert and Elliott)")
    trace: Trace | None = parameter(None, help="replay of measured links")
    delays: Delays | None = parameter(None, help="a further delay, for each receiver")
    measures: Measures = field(default_factory=Measures)
    interface: Interface | None = parameter(None, help="network interfaces of the robots, for programs; real time only")

    @property
    def frame_headers_bytes(self) -> int:
        """Bytes of an interface's frame that `overhead_bytes` already counts.

        IEEE 802.11 replaces Ethernet's header by its own, and `overhead_bytes` counts the IPv4 and UDP headers of
        messages, which a frame contains. Other radios carry the entire frame.
        """
        return HEADER_BYTES + DATAGRAM_BYTES if self.frame.startswith("802.11") else 0

    @property
    def mtu_bytes(self) -> int:
        """Size of the largest IP packet in an interface's frame."""
        return self.max_payload_bytes + self.frame_headers_bytes - HEADER_BYTES

    @property
    def is_phy(self) -> bool:
        """True if the radio has a PHY: signals have a strength."""
        return self.model != "unit-disk"

    @property
    def acknowledges(self) -> bool:
        """True if senders get a transmit status for each unicast packet."""
        return self.is_phy and self.access_or_default.acknowledges

    @property
    def needs(self) -> tuple[str, ...]:
        """Names under `radio.` that agents may declare in their `needs`."""
        return (*self.measures.needs, "radio.tx_status") if self.acknowledges else self.measures.needs

    @property
    def needs_line_of_sight(self) -> bool:
        """True if obstacles block the signal."""
        return not self.is_phy if self.line_of_sight is None else self.line_of_sight

    @property
    def path_loss_model(self) -> LogDistance | Friis | TwoRay | ItuIndoor:
        """The path loss model.

        Raises:
            ValueError: the radio is a unit disk.
        """
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
        """The antenna of the scenario, or the default."""
        return self.antenna or Antenna()

    @property
    def noise_or_default(self) -> ReceiverNoise:
        """The receiver noise of the scenario, or the default; LoRa has the bandwidth of its modulation."""
        noise, lora = self.noise or ReceiverNoise(), self.lora_or_none
        return noise if lora is None else replace(noise, bandwidth_hz=lora.bandwidth_hz)

    @property
    def lora_or_none(self) -> Lora | None:
        """The modulation of a radio with LoRa, None for others."""
        return self.lora or Lora() if self.frame == "lora" else None

    @property
    def despreading_db(self) -> float:
        """What the detector takes off noise and jammers, beside frames of other robots; 0 except for LoRa."""
        return 0.0 if self.lora_or_none is None else self.lora_or_none.despreading_db

    @property
    def detector_noise_dbm(self) -> float:
        """Noise at the detector in dBm, on the scale of received signals."""
        return self.noise_or_default.power_dbm - self.despreading_db

    @property
    def reception_or_default(self) -> Reception:
        """The reception of the scenario, or the default; that of LoRa follows from its modulation."""
        return LORA_RECEPTION if self.frame == "lora" else self.reception or Reception()

    @property
    def access_or_default(self) -> Access:
        """The channel access of the scenario, or the default."""
        return self.access or Access()


# Checks of several keys: an error names the key that contradicts another.


PHY_KEYS = ("lora", "antenna", "shadowing", "walls", "bodies", "fading", "noise", "reception", "access", "advertising")
MODEL_KEYS = {"log_distance": "log-distance", "two_ray": "two-ray", "itu_indoor": "itu-indoor"}
OFDM_MODELS = ("802.11ag", "802.11ag-nist")
RECEPTIONS = {  # besides threshold and table
    "802.11a": OFDM_MODELS,
    "802.11b": ("802.11b",),
    "802.11g": OFDM_MODELS,
    "802.11n": OFDM_MODELS,
    "esb": (),
}
ACCESS_KEYS = {  # methods of keys of [radio.access] that only some have
    "cca_threshold_dbm": ("csma-802154", "dcf"),
    "max_retries": ("csma-802154", "dcf", "esb"),
    "cca_sensitivity_dbm": ("dcf",),
    "cca_time_s": ("dcf",),
    "station": ("esb",),
    "host_delay_s": ("esb",),
    "safelink": ("esb",),
}
RATES_BPS = {
    "802.11a": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11b": DSSS_RATES_BPS,
    "802.11g": tuple(OFDM_BITS_PER_SYMBOL),
    "802.11n": tuple(HT_BITS_PER_SYMBOL),
    "esb": ESB_RATES_BPS,
}


def check_radio(radio: Radio, where: str) -> None:
    """Raise BadInput for the first contradiction in a scenario's `[radio]`."""
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
    _check_lora(radio, where)
    if radio.interface is not None:
        _check_interface(radio, radio.interface, where)


def _check_lora(radio: Radio, where: str) -> None:
    lora = radio.lora_or_none
    if lora is None:
        if radio.lora is not None:
            raise BadInput(where, "radio.lora", f'expected frame = "lora" with it, got "{radio.frame}"')
        return
    if not radio.is_phy:
        raise BadInput(where, "radio.frame", 'expected a model with a PHY for "lora": a unit disk has no modulation')
    if radio.bit_rate_bps != Radio.bit_rate_bps:
        raise BadInput(where, "radio.bit_rate_bps", 'expected none for frame = "lora": radio.lora determines it')
    if radio.reception is not None:
        raise BadInput(where, "radio.reception", 'expected none for frame = "lora": radio.lora determines it')
    if radio.noise is not None and radio.noise.bandwidth_hz != ReceiverNoise.bandwidth_hz:
        raise BadInput(where, "radio.noise.bandwidth_hz", "expected none: radio.lora.bandwidth_hz determines it")
    refuse_unfit_lora(lora, radio.overhead_bytes, radio.max_payload_bytes, where)


def check_spreading(radio: Radio, spreading_factor: int, where: str, key: str) -> None:
    """Raise BadInput if robots cannot have this spreading factor; `key` is that of their radio."""
    lora = radio.lora_or_none
    if lora is None:
        raise BadInput(where, f"{key}.spreading_factor", f'expected frame = "lora" with it, got "{radio.frame}"')
    if radio.access_or_default.method == "cad" and spreading_factor != lora.spreading_factor:
        expected = f"expected {lora.spreading_factor}, that of the radio, with access method cad"
        raise BadInput(where, f"{key}.spreading_factor", f"{expected}; got {spreading_factor}")
    lora = replace(lora, spreading_factor=spreading_factor)
    refuse_unfit_lora(lora, radio.overhead_bytes, radio.max_payload_bytes, where)


def _check_interface(radio: Radio, interface: Interface, where: str) -> None:
    try:
        network = IPv4Network(interface.network)
        if network.is_loopback or network.is_multicast:
            raise ValueError(f"{network} has no addresses of hosts")
    except ValueError as error:
        expected = f"expected an IPv4 network such as 10.77.0.0/16: {error}"
        raise BadInput(where, "radio.interface.network", expected) from None
    if radio.mtu_bytes < MIN_MTU_BYTES:
        least = radio.max_payload_bytes + MIN_MTU_BYTES - radio.mtu_bytes
        expected = f"expected at least {least} for an interface: IPv4 needs {MIN_MTU_BYTES} bytes in a frame"
        raise BadInput(where, "radio.max_payload_bytes", f"{expected}; got {radio.max_payload_bytes}")


def unfit_for_torus(radio: Radio) -> str | None:
    """Return the key that a torus excludes, if any: only the unit disk computes distances across the seam."""
    return "model" if radio.is_phy else "bodies_block" if radio.bodies_block else None


def _check_unit_disk(radio: Radio, where: str) -> None:
    if radio.range_m is None:
        raise BadInput(
            where, "radio.range_m", "is missing; expected a number above 0 (m): the unit disk requires a range"
        )
    for name in PHY_KEYS:
        if getattr(radio, name) is not None:
            raise BadInput(where, f"radio.{name}", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.measures.rssi is not None:
        raise BadInput(where, "radio.measures.rssi", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.cut_off_db != Radio.cut_off_db:
        raise BadInput(where, "radio.cut_off_db", "expected a model with a PHY: a unit disk has no signal strength")
    if radio.queue_lifetime_s is not None:
        raise BadInput(
            where, "radio.queue_lifetime_s", "expected a model with a PHY: a unit disk has no lifetime in queues"
        )


def _check_phy(radio: Radio, where: str) -> None:
    refuse_unfit(radio.reception_or_default, radio.bit_rate_bps, where, "radio.reception")
    check_pattern(radio.antenna_or_default.pattern, where, "radio.antenna.pattern")
    if radio.bodies_block:
        raise BadInput(where, "radio.bodies_block", "expected the model unit disk with it; a PHY has radio.bodies")
    if radio.walls is not None and radio.needs_line_of_sight:
        raise BadInput(where, "radio.walls", "expected no line_of_sight with it: obstacles either block or weaken")
    method, advertising = radio.access_or_default.method, radio.advertising
    if advertising is not None and method != "advertising":
        raise BadInput(where, "radio.advertising", f'expected access.method = "advertising" with it, got "{method}"')
    if advertising is not None and (advertising.scan_window_s or 0.0) > advertising.scan_interval_s:
        expected = f"expected at most scan_interval_s, {advertising.scan_interval_s:g}"
        raise BadInput(where, "radio.advertising.scan_window_s", f"{expected}; got {advertising.scan_window_s:g}")
    if method == "dcf" and not radio.frame.startswith("802.11"):
        raise BadInput(where, "radio.access.method", 'expected a frame of IEEE 802.11 for "dcf", such as 802.11b')
    if method != "dcf" and radio.frame == "802.11n":
        raise BadInput(where, "radio.access.method", f'expected "dcf" for frames of 802.11n, got "{method}"')
    if method in ("csma-802154", "advertising") and radio.frame != "plain":
        raise BadInput(where, "radio.access.method", f'expected frame = "plain" for "{method}", got {radio.frame}')
    if (method == "esb") != (radio.frame == "esb"):
        raise BadInput(where, "radio.access.method", f'expected "esb" with frame = "esb" alone; got {method}')
    if method == "esb" and not radio.access_or_default.acknowledged:
        raise BadInput(where, "radio.access.acknowledged", "expected true with method esb: an answer is one")
    if method == "esb" and radio.max_payload_bytes > ESB.max_payload_octets:
        expected = f"expected at most {ESB.max_payload_octets} with frames of esb; got {radio.max_payload_bytes}"
        raise BadInput(where, "radio.max_payload_bytes", expected)
    if method == "cad" and radio.frame != "lora":
        raise BadInput(where, "radio.access.method", f'expected frame = "lora" for "cad", got {radio.frame}')


def _check_fits(radio: Radio, where: str) -> None:
    """Raise BadInput for a key that the chosen access, reception, frame or fading does not use."""
    access, reception, fading = radio.access_or_default, radio.reception_or_default, radio.fading
    for name, methods in ACCESS_KEYS.items():
        if getattr(access, name) != getattr(Access, name) and access.method not in methods:
            expected = f"expected method {' or '.join(methods)} with it"
            raise BadInput(where, f"radio.access.{name}", f'{expected}, got "{access.method}"')
    max_retries = 15 if access.method == "esb" else 7
    if (access.max_retries or 0) > max_retries:
        expected = f"expected at most {max_retries} with method {access.method}; got {access.max_retries}"
        raise BadInput(where, "radio.access.max_retries", expected)
    for name in ("aggregation_bytes", "rts_threshold_bytes", "rate_control"):
        if getattr(access, name) != getattr(Access, name) and radio.frame != "802.11n":
            raise BadInput(where, f"radio.access.{name}", f'expected frame = "802.11n" with it, got "{radio.frame}"')
    fits = ("threshold", "table", *RECEPTIONS.get(radio.frame, (reception.model,)))
    if reception.model not in fits:
        expected = f"expected one of {', '.join(fits)} for frames of {radio.frame}; got {reception.model}"
        raise BadInput(where, "radio.reception.model", expected)
    conditional = {
        "reception.table": (reception.table is not None, reception.model, "table"),
        "reception.min_sinr_db": (reception.min_sinr_db != Reception.min_sinr_db, reception.model, "threshold"),
    }
    if fading is not None:
        conditional["fading.k"] = fading.k != Fading.k, fading.distribution, "rician"
        conditional["fading.m"] = fading.m != Fading.m, fading.distribution, "nakagami"
    for key, (is_set, chosen, needed) in conditional.items():
        if is_set and chosen != needed:
            raise BadInput(where, f"radio.{key}", f'expected "{needed}" with it, got "{chosen}"')
