"""Notes: the states that agents name for whoever looks on (`note(state="search")`). They change nothing in the run."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import IntArray

LONGEST_STATE = 64  # characters
MOST_STATES = 256  # different ones in a run; what a runner names in a tick is bounded by the same number


@dataclass(frozen=True, slots=True)
class Notes:
    """The states that some robots named in one tick, a row per robot that did."""

    rows: IntArray  # (k,) robot row: arena x robots + index, each once
    code: IntArray  # (k,) place in `names`
    names: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def none(cls) -> "Notes":
        """Nobody named a state."""
        return _NO_NOTES

    @classmethod
    def joined(cls, parts: "list[Notes]") -> "Notes":
        """The notes of all parts."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else cls.none()
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        place = {name: code for code, name in enumerate(names)}
        codes = [np.array([place[name] for name in part.names])[part.code] for part in parts]
        return cls(np.concatenate([part.rows for part in parts]), np.concatenate(codes), names)


_NO_NOTES = Notes(np.empty(0, np.int64), np.empty(0, np.int64))


def checked_state(state: object) -> str:
    """The state; ValueError unless it is a text of 1 to 64 characters."""
    if not isinstance(state, str) or not 0 < len(state) <= LONGEST_STATE:
        raise ValueError(f"note(state=…): expected a text of 1 to {LONGEST_STATE} characters, got {state!r}")
    return state
