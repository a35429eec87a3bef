"""What a run that is repeated takes from the run before."""

from dataclasses import dataclass

from swarmwire.deploy.record.inputs import RecordedInputs
from swarmwire.world.live_events import LiveEvent


@dataclass(frozen=True)
class Replay:
    """How far a run is repeated, and what came into it from outside."""

    ticks: int  # instead of the scenario's
    inputs: RecordedInputs | None  # None: all follows from scenario and seed
    live_events: tuple[LiveEvent, ...] = ()  # what people did to it
    subtick_s: float | None = None  # at which packets came in the middle of ticks; None: at their starts
