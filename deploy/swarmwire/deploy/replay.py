"""What a run that is repeated takes from the run before."""

from dataclasses import dataclass

from swarmwire.deploy.record.inputs import RecordedInputs


@dataclass(frozen=True)
class Replay:
    """How far a run is repeated, and what came into it from outside."""

    ticks: int  # instead of the scenario's
    inputs: RecordedInputs | None  # None: all follows from scenario and seed
    within_ticks: bool = False  # whether packets came in the middle of ticks
