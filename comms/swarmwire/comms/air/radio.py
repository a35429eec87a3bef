"""What a scenario says of its radio."""

from dataclasses import dataclass, field

from swarmwire.comms.air.parameters.access import Access
from swarmwire.comms.air.parameters.bursts import Bursts
from swarmwire.comms.air.parameters.delays import Delays
from swarmwire.comms.air.parameters.gives import Gives
from swarmwire.comms.air.parameters.propagation import Antenna, Bodies, Fading, Shadowing, Walls
from swarmwire.comms.air.parameters.reception import Reception
from swarmwire.comms.air.parameters.trace import Trace
from swarmwire.comms.air.presets.registry import PRESETS
from swarmwire.comms.air.propagation.friis import Friis
from swarmwire.comms.air.propagation.itu_indoor import ItuIndoor
from swarmwire.comms.air.propagation.log_distance import LogDistance
from swarmwire.comms.air.propagation.two_ray import TwoRay
from swarmwire.comms.air.reception.noise import Noise
from swarmwire.comms.parameters import parameter

MODELS = ("disk", "log-distance", "friis", "two-ray", "itu-indoor")
FRAMES = ("plain", "802.11a", "802.11b", "802.11g")


@dataclass(frozen=True)
class Radio:
    """The radio: either reaches to a fixed distance (disk), or sends signals that fade with distance."""

    range_m: float | None = parameter(
        None,
        help="no packet reaches receivers farther than this, centre to centre, but over measured links; disks need it",
        unit="m",
        above=0,
    )
    model: str = parameter("disk", help="how the signal fades with distance", choices=MODELS)
    preset: str | None = parameter(
        None, help="a kind of radio, whose values count where the scenario gives none", choices=tuple(PRESETS)
    )
    line_of_sight: bool | None = parameter(
        None, help="obstacles block the signal; without it true for the disk, false for signals"
    )
    bodies_block: bool = parameter(False, help="of the disk: robots in between block the signal, as obstacles do")
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
        10.0,
        help="of signals: a robot with a mean strength so far below noise and sensitivity neither hears nor disturbs; "
        "less is faster",
        unit="dB",
        at_least=0,
        at_most=60,
    )
    propagation_mps: float | None = parameter(
        None,
        help="speed of the wave, for sound and the like: packets are heard later with distance, though they are on "
        "air everywhere at once, and fading goes by this wave's length; without it that of light, and no delay",
        unit="m/s",
        at_least=1,
        at_most=3e8,
    )
    frequency_hz: float = parameter(2.44e9, help="of signals: the carrier", unit="Hz", at_least=1e3, at_most=1e12)
    log_distance: LogDistance | None = parameter(None, help="of the model log-distance")
    two_ray: TwoRay | None = parameter(None, help="of the model two-ray")
    itu_indoor: ItuIndoor | None = parameter(None, help="of the model itu-indoor")
    antenna: Antenna | None = parameter(None, help="of signals: power and gain")
    shadowing: Shadowing | None = parameter(None, help="of signals: what is not modelled varies from place to place")
    walls: Walls | None = parameter(None, help="of signals: obstacles weaken, where they do not block")
    bodies: Bodies | None = parameter(None, help="of signals: robots in between weaken")
    fading: Fading | None = parameter(None, help="of signals: power varies over fractions of a wavelength")
    noise: Noise | None = parameter(None, help="of signals: the receiver's own noise")
    reception: Reception | None = parameter(None, help="of signals: when a frame is right")
    access: Access | None = parameter(None, help="of signals: who may send when, and whether frames collide")
    bursts: Bursts | None = parameter(None, help="links are bad for a while, and good again")
    trace: Trace | None = parameter(None, help="measured links are replayed")
    delays: Delays | None = parameter(None, help="a further delay, for each receiver")
    gives: Gives = field(default_factory=Gives)

    @property
    def is_signal(self) -> bool:
        """Whether there is a signal with a strength."""
        return self.model != "disk"

    @property
    def acknowledges(self) -> bool:
        """Whether senders learn what became of addressed packets."""
        return self.is_signal and self.access_or_default.acknowledges

    @property
    def tells(self) -> tuple[str, ...]:
        """What agents may need of it, by the names that they declare."""
        return (*self.gives.needs, "radio.outcomes") if self.acknowledges else self.gives.needs

    @property
    def needs_line_of_sight(self) -> bool:
        """Whether obstacles block."""
        return not self.is_signal if self.line_of_sight is None else self.line_of_sight

    @property
    def loss_model(self) -> LogDistance | Friis | TwoRay | ItuIndoor:
        """Path loss by the signal's model; ValueError for the disk."""
        if self.model == "log-distance":
            return self.log_distance or LogDistance()
        if self.model == "two-ray":
            return self.two_ray or TwoRay()
        if self.model == "itu-indoor":
            return self.itu_indoor or ItuIndoor()
        if self.model == "friis":
            return Friis()
        raise ValueError("model: a disk has no path loss")

    @property
    def antenna_or_default(self) -> Antenna:
        """The antenna, standard values where nothing was given."""
        return self.antenna or Antenna()

    @property
    def noise_or_default(self) -> Noise:
        """The noise, standard values where nothing was given."""
        return self.noise or Noise()

    @property
    def reception_or_default(self) -> Reception:
        """The reception, standard values where nothing was given."""
        return self.reception or Reception()

    @property
    def access_or_default(self) -> Access:
        """The access, standard values where nothing was given."""
        return self.access or Access()
