"""The axis below groups that stand side by side: their labels, turned or thinned out where they would touch."""

from collections.abc import Sequence
from typing import Any

from swarmwire.metrics.report.figures.column_axes import FOOT_IN
from swarmwire.metrics.report.in_words import shortened

_LETTERS = 44  # that fit below a column's figure side by side
_FEWEST = 5  # groups for which there is room, so that two do not look like barrels
_LONGEST = 14
_MAX_TURNED = 18


def room_below_in(labels: Sequence[str]) -> float:
    """What `column_axes` should leave below the axes for these labels."""
    if not _turned(labels):
        return FOOT_IN
    return FOOT_IN + 0.035 * min(max(map(len, labels)), _LONGEST)


def set_categories(axes: Any, labels: Sequence[str]) -> None:
    """Label the groups, which stand at 0, 1, 2 and so on."""
    aside = 0.6 + 0.5 * max(0, _FEWEST - len(labels))
    axes.set_xlim(-aside, len(labels) - 1 + aside)
    if not _turned(labels):
        every = -(-_letters(labels) // _LETTERS)
        axes.set_xticks(range(0, len(labels), every), labels[::every])
        return
    every = -(-len(labels) // _MAX_TURNED)
    short = [shortened(label, _LONGEST) for label in labels[::every]]
    axes.set_xticks(range(0, len(labels), every), short, rotation=30, ha="right", rotation_mode="anchor")


def _turned(labels: Sequence[str]) -> bool:
    """Numbers may be thinned out, names may not."""
    return _letters(labels) > _LETTERS and not all(_is_number(label) for label in labels)


def _letters(labels: Sequence[str]) -> int:
    return sum(len(label) + 2 for label in labels)


def _is_number(label: str) -> bool:
    try:
        float(label)
    except ValueError:
        return False
    return True
