"""The scenario table `[radio]`. No kernels: a scenario is read without a compiler."""

from dataclasses import dataclass, field, replace

from swarmwire.comms.base.config import parameter
from swarmwire.comms.base.ethernet import HEADER_BYTES
from swarmwire.comms.radio.config.antennas import Antenna
from swarmwire.comms.radio.config.impairments import Bursts, Delays, Measures
from swarmwire.comms.radio.config.lora import LORA_RECEPTION, Lora
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
)
from swarmwire.comms.radio.config.presets import PRESETS


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
POSITIONS = ("held", "interpolated")
MODELS = ("unit-disk", "log-distance", "friis", "two-ray", "itu-indoor")
FRAMES = ("plain", "802.11a", "802.11b", "802.11g", "802.11n", "esb", "lora")


@dataclass(frozen=True)
class Radio:
    """The radio: a unit disk of fixed range, or a PHY whose signals weaken with distance."""

    range_m: float | None = parameter(
        None,
        help="greatest distance in space to receivers, except on links of measured strength; required by the unit disk",
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
