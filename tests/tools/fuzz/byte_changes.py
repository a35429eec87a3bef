"""Bytes changed as a broken link, disk or sender changes them: a few changes at a time, each of its own kind."""

from collections.abc import Callable, Sequence

from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.magic import BYTES

Change = Callable[[Dice, bytearray, Sequence[bytes]], None]
MOST_CHANGES = 5
MOST_BYTES = 1 << 20  # what doubles again and again would tell of the machine alone
LENGTHS = ((1, 0xFF), (2, 0xFFFF), (4, 0xFFFFFFFF))


def changed_bytes(dice: Dice, data: bytes, others: Sequence[bytes]) -> bytes:
    """These bytes after some changes; pieces of `others` may come in."""
    found = bytearray(data)
    for _ in range(dice.few(MOST_CHANGES)):
        dice.pick(CHANGES)(dice, found, others)
    return bytes(found[:MOST_BYTES])


def _span(dice: Dice, data: bytearray, longest: int = 64) -> tuple[int, int]:
    """Start and end of a piece, mostly a short one."""
    start = dice.below(len(data) + 1)
    length = dice.below(len(data) + 1) if dice.chance(0.1) else 1 + dice.below(longest)
    return start, min(len(data), start + length)


def _flip(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    if data:
        data[dice.below(len(data))] ^= 1 << dice.below(8)


def _set(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    if data:
        data[dice.below(len(data))] = dice.below(256)


def _overwrite(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    magic, at = dice.pick(BYTES), dice.below(len(data) + 1)
    data[at : at + len(magic)] = magic


def _insert(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    at = dice.below(len(data) + 1)
    data[at:at] = dice.pick(BYTES) if dice.chance(0.5) else dice.some_bytes(1 + dice.below(16))


def _cut_out(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    start, end = _span(dice, data)
    del data[start:end]


def _cut_short(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    del data[dice.below(len(data) + 1) :]


def _double(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    start, end = _span(dice, data)
    data[end:end] = data[start:end] * (1 + dice.below(4))


def _move(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    start, end = _span(dice, data)
    piece = data[start:end]
    del data[start:end]
    at = dice.below(len(data) + 1)
    data[at:at] = piece


def _splice(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    """Up to here this one, from there on another: or a piece of the other in the midst of this."""
    other = dice.pick(others)
    at, there = dice.below(len(data) + 1), dice.below(len(other) + 1)
    if dice.chance(0.5):
        data[at:] = other[there:]
    else:
        data[at:at] = other[there : there + 1 + dice.below(64)]


def _length(dice: Dice, data: bytearray, others: Sequence[bytes]) -> None:
    """What may be a length is one more or less, or twice as much."""
    size, mask = dice.pick(LENGTHS)
    if len(data) < size:
        return
    at, order = dice.below(len(data) - size + 1), "big" if dice.chance(0.5) else "little"
    value = int.from_bytes(data[at : at + size], order)
    value = dice.pick((value + 1, value - 1, value * 2, value // 2, mask)) & mask
    data[at : at + size] = value.to_bytes(size, order)


CHANGES: tuple[Change, ...] = (
    *(_flip, _set, _overwrite, _insert, _cut_out, _cut_short),
    *(_double, _move, _splice, _length),
)
