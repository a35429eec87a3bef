"""LEDs that agents switched in a tick; all others stay as they are."""

from dataclasses import dataclass

import numpy as np

from swarmwire.comms.arrays import IntArray


@dataclass(frozen=True, slots=True)
class LedChanges:
    """The LEDs of some robots that got a colour in one tick, a row each; of two rows of an LED the later counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    which: IntArray  # (k,) place of the LED in the body's sheet
    rgb: IntArray  # (k,) 0xRRGGBB; 0: dark

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[LedChanges]") -> "LedChanges":
        """The changes of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_LED_CHANGES
        names = ("rows", "which", "rgb")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


NO_LED_CHANGES = LedChanges(*np.empty((3, 0), np.int64))  # nobody switches any
