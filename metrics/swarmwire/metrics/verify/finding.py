"""What a check says of one part of a run folder."""

from dataclasses import dataclass
from enum import StrEnum


class State(StrEnum):
    """How a part of a run folder is."""

    INTACT = "intact"
    NOT_RECORDED = "not recorded"  # and nothing says that it should be there
    PARTIAL = "partial"  # readable, but not to the end of the run
    MISSING = "missing"
    DAMAGED = "damaged"
    DIFFERS = "differs"  # readable, but not what the summary says


@dataclass(frozen=True, slots=True)
class Finding:
    """One part of a run folder, how it is, and one line that says more."""

    part: str
    state: State
    text: str

    @property
    def good(self) -> bool:
        """Whether nothing is wrong with it."""
        return self.state in (State.INTACT, State.NOT_RECORDED)
