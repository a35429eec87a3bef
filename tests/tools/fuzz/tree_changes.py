"""Trees of plain values changed: keys dropped and renamed, values of other types and sizes, parts of other trees.

A tree is what msgpack, TOML and JSON know: maps, lists, texts, bytes, numbers. What is given is never written to.
"""

import struct
from collections.abc import Callable, Sequence
from typing import Any

from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.magic import BEYOND_MSGPACK, BROKEN, TEXTS, WHOLE

MOST_CHANGES = 4
DEEPER = 0.85  # how often a change goes on to a part of what it came to
DEPTHS = (3, 30, 200)  # of nested lists or maps; msgpack itself ends at 512
MOST_TIMES = 400


def changed_tree(dice: Dice, tree: Any, others: Sequence[Any]) -> Any:
    """This tree after some changes; parts of `others` may come in."""
    for _ in range(dice.few(MOST_CHANGES)):
        tree = _changed(dice, tree, others)
    return tree


def _changed(dice: Dice, node: Any, others: Sequence[Any]) -> Any:
    """The same with one part changed, however deep."""
    if isinstance(node, dict) and node and dice.chance(DEEPER):
        key = dice.pick(list(node))
        return {**node, key: _changed(dice, node[key], others)}
    if isinstance(node, list) and node and not (_is_array(node) and dice.chance(0.5)) and dice.chance(DEEPER):
        at = dice.below(len(node))
        return [*node[:at], _changed(dice, node[at], others), *node[at + 1 :]]
    if dice.chance(0.15):
        return dice.pick(ANYWHERE)(dice, node, others)
    for kind, changes in OF_KIND.items():
        if type(node) is kind:
            return dice.pick(changes)(dice, node, others)
    return _another(dice, node, others)


# What may become of any value.


def _another(dice: Dice, node: Any, others: Sequence[Any]) -> Any:
    plain = (None, True, False, [], {}, [[]], {"": None}, b"", dice.pick(WHOLE), dice.pick(BROKEN), dice.pick(TEXTS))
    return dice.pick(plain)


def _nested(dice: Dice, node: Any, others: Sequence[Any]) -> Any:
    in_maps = dice.chance(0.5)
    for _ in range(dice.pick(DEPTHS)):
        node = {"a": node} if in_maps else [node]
    return node


def _of_another(dice: Dice, node: Any, others: Sequence[Any]) -> Any:
    found = dice.pick(others)
    while isinstance(found, dict | list) and found and dice.chance(DEEPER):
        found = dice.pick(list(found.values()) if isinstance(found, dict) else found)
    return found


# Maps.


def _dropped(dice: Dice, node: dict[Any, Any], others: Sequence[Any]) -> Any:
    gone = dice.pick(list(node)) if node else None
    return {key: value for key, value in node.items() if key != gone}


def _renamed(dice: Dice, node: dict[Any, Any], others: Sequence[Any]) -> Any:
    if not node:
        return {dice.pick(TEXTS): None}
    old = dice.pick(list(node))
    new = dice.pick((f"{old}x", str(old)[:-1], str(old).upper(), dice.pick(TEXTS)))
    return {new if key == old else key: value for key, value in node.items()}


def _added(dice: Dice, node: dict[Any, Any], others: Sequence[Any]) -> Any:
    """A key of another tree, or one that nobody knows."""
    other = _of_another(dice, None, [part for part in others if isinstance(part, dict)] or [{}])
    if isinstance(other, dict) and other:
        key = dice.pick(list(other))
        return {**node, key: other[key]}
    return {**node, dice.pick(TEXTS): other}


def _swapped(dice: Dice, node: dict[Any, Any], others: Sequence[Any]) -> Any:
    if not node:
        return node
    one, two = dice.pick(list(node)), dice.pick(list(node))
    return {**node, one: node[two], two: node[one]}


# Lists.


def _without(dice: Dice, node: list[Any], others: Sequence[Any]) -> Any:
    at = dice.below(len(node))
    return [*node[:at], *node[at + 1 :]]


def _repeated(dice: Dice, node: list[Any], others: Sequence[Any]) -> Any:
    if not node:
        return [_another(dice, None, others)]
    at, times = dice.below(len(node)), dice.pick((2, 3, MOST_TIMES))
    return [*node[:at], *([node[at]] * times), *node[at + 1 :]]


def _in_another_order(dice: Dice, node: list[Any], others: Sequence[Any]) -> Any:
    at = dice.below(len(node) + 1)
    return node[::-1] if dice.chance(0.5) else node[at:] + node[:at]


def _array(dice: Dice, node: list[Any], others: Sequence[Any]) -> Any:
    """An array of a frame (dtype, shape, bytes), which still is one."""
    if not _is_array(node):
        return _without(dice, node, others)
    code, shape, data = node
    change = dice.below(5)
    if change == 0:  # as many items in another shape
        flat = 1
        for length in shape:
            flat *= length if type(length) is int else 0
        return [code, dice.pick(([flat], [1, flat], [flat, 1], [0, flat], shape[::-1])), data]
    if change == 1 and shape and type(shape[-1]) is int:  # one item less, or more, in the last axis
        return _longer(dice, code, shape, data)
    if change == 2:  # as many bytes of another type
        return [dice.pick(("<f8", "<i8", "<u8", "|b1", "|u1", "<f4", ">i8", "O", "")), shape, data]
    if change == 3:  # none
        return [code, [*shape[:-1], 0] if dice.chance(0.5) else [0], b""]
    return [code, shape, _items(dice, data, others)]


def _longer(dice: Dice, code: Any, shape: list[Any], data: bytes) -> Any:
    lines = 1
    for length in shape[:-1]:
        lines *= length if type(length) is int else 0
    last, each = shape[-1], len(data) // max(1, lines * shape[-1])
    if not 0 < lines <= 1000 or not each:
        return [code, shape, data]
    rows = [data[line * last * each : (line + 1) * last * each] for line in range(lines)]
    if dice.chance(0.5):
        return [code, [*shape[:-1], last + 1], b"".join(row + row[:each] for row in rows)]
    return [code, [*shape[:-1], max(0, last - 1)], b"".join(row[each:] for row in rows)]


def _is_array(node: list[Any]) -> bool:
    return len(node) == 3 and type(node[0]) is str and type(node[1]) is list and type(node[2]) is bytes


# Plain values.


def _text(dice: Dice, node: str, others: Sequence[Any]) -> Any:
    at = dice.below(len(node) + 1)
    return dice.pick((node[:at], node[at:], node + node, node[:at] + dice.pick(TEXTS) + node[at:], dice.pick(TEXTS)))


def _whole(dice: Dice, node: int, others: Sequence[Any]) -> Any:
    if dice.chance(0.03):
        return dice.pick(BEYOND_MSGPACK)
    return dice.pick((node + 1, node - 1, -node, node * 2, node * 10, node / 3, str(node), dice.pick(WHOLE)))


def _number(dice: Dice, node: float, others: Sequence[Any]) -> Any:
    return dice.pick(
        (-node, node * 2, node * 10, node / 10, node + 1.0, str(node), dice.pick(BROKEN), dice.pick(WHOLE))
    )


def _items(dice: Dice, node: bytes, others: Sequence[Any]) -> Any:
    """One item of an array replaced, or the bytes cut."""
    if len(node) < 8 or dice.chance(0.2):
        return dice.pick((node[:-1], node + b"\x00", node[: dice.below(len(node) + 1)], dice.some_bytes(len(node))))
    at = 8 * dice.below(len(node) // 8)
    whole = dice.pick(WHOLE)
    item = struct.pack("<d", dice.pick(BROKEN)) if dice.chance(0.5) else (whole % 2**64).to_bytes(8, "little")
    return node[:at] + item + node[at + 8 :]


Change = Callable[[Dice, Any, Sequence[Any]], Any]
ANYWHERE: tuple[Change, ...] = (_another, _another, _of_another, _nested)
OF_KIND: dict[type, tuple[Change, ...]] = {
    dict: (_dropped, _renamed, _added, _swapped),
    list: (_without, _repeated, _in_another_order, _array),
    str: (_text,),
    int: (_whole,),
    float: (_number,),
    bytes: (_items,),
}
