"""Draws of one case: keyed by seed, target and number, so that any case can be run again alone.

Plain integers of splitmix64: a numpy generator takes longer to make than most cases take to try.
"""

import hashlib
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")
MASK = 2**64 - 1


class Dice:
    """All that is drawn for one case."""

    def __init__(self, seed: int, target: str, number: int) -> None:
        key = hashlib.blake2b(f"{seed}/{target}/{number}".encode(), digest_size=8)
        self._state = int.from_bytes(key.digest(), "little")

    def bits(self) -> int:
        """A number of 64 bits."""
        self._state = state = (self._state + 0x9E3779B97F4A7C15) & MASK
        state = ((state ^ (state >> 30)) * 0xBF58476D1CE4E5B9) & MASK
        state = ((state ^ (state >> 27)) * 0x94D049BB133111EB) & MASK
        return state ^ (state >> 31)

    def below(self, end: int) -> int:
        """A whole number from 0, below `end`; 0 where there is none."""
        return (self.bits() * end) >> 64

    def chance(self, share: float) -> bool:
        """Whether what happens in this share of cases happens in this."""
        return self.bits() < share * 2**64

    def pick(self, some: Sequence[T]) -> T:
        """One of some."""
        return some[self.below(len(some))]

    def few(self, most: int) -> int:
        """From 1 to `most`, each half as often as the one before."""
        count = 1
        while count < most and self.bits() & 1:
            count += 1
        return count

    def some_bytes(self, count: int) -> bytes:
        """As many bytes, of any value."""
        return b"".join(self.bits().to_bytes(8, "little") for _ in range(count // 8 + 1))[:count]
