"""Which robots the words after a command mean, as the table that events have for it."""

from collections.abc import Sequence
from typing import Any

from swarmwire.comms.errors import BadInput

ALL = "all"


def selection_of(words: Sequence[str]) -> dict[str, Any]:
    """The selection of names, or of a group, a number or a share, or of both; BadInput for anything else.

    >>> selection_of(["flock-3", "flock-7"]), selection_of(["flock", "20%"]), selection_of(["all"])
    ({'names': ['flock-3', 'flock-7']}, {'group': 'flock', 'share': 0.2}, {'share': 1.0})
    """
    given = [part for word in words for part in word.split(",") if part]
    if given == [ALL]:
        return {"share": 1.0}
    if given and all(_is_name(word) for word in given):
        return {"names": given}
    amounts = [word for word in given if word[:1].isdigit()]
    groups = [word for word in given if word not in amounts]
    if len(amounts) > 1 or len(groups) > 1 or any(map(_is_name, groups)):
        expected = "expected names such as flock-3, or a group, a number or share of it such as 5 or 20%, or all"
        raise BadInput("ROBOTS", "", f"{expected}; got {' '.join(words)}")
    selection: dict[str, Any] = {"group": groups[0]} if groups else {}
    return selection | (_amount(amounts[0]) if amounts else {})


def _is_name(word: str) -> bool:
    group, dash, number = word.rpartition("-")
    return bool(group and dash) and number.isdecimal()


def _amount(word: str) -> dict[str, Any]:
    try:
        return {"share": float(word[:-1]) / 100.0} if word.endswith("%") else {"count": int(word)}
    except ValueError:
        raise BadInput("ROBOTS", "", f"expected a number such as 5, or a share such as 20%; got {word!r}") from None
