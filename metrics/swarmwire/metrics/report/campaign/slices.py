"""Which design points a figure over one or two parameters is about, given that there may be others."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.report.campaign.levels import Levels, levels_of

MAX_SLICES = 4


@dataclass(frozen=True)
class Slice:
    """Some of the design points."""

    label: str  # the values that they share: "robots.flock.count 20", "" for all points
    short: str  # the values alone
    points: frozenset[int]

    def cell(self, *at: tuple[Levels, int]) -> tuple[int, ...]:
        """Those of its points that are at these levels."""
        found = set(self.points)
        for levels, level in at:
            found &= set(levels.points(level))
        return tuple(sorted(found))


def slices_beside(folder: CampaignFolder, shown: Sequence[str], *, names_apart: bool = True) -> list[Slice]:
    """The design points by what is not shown: numbers of a grid at their middle value, names one by one.

    Numbers of other designs are taken together, and so are names unless `names_apart` and their combinations are
    MAX_SLICES at most.
    """
    whole = Slice("", "", frozenset(range(len(folder.points))))
    others = [levels_of(path, folder.points) for path in folder.parameters if path not in shown]
    others = [levels for levels in others if len(levels) > 1]
    if folder.about.design != "grid":
        others = [levels for levels in others if levels.number is None]
    names = prod(len(levels) for levels in others if levels.number is None)
    if not names_apart or names > MAX_SLICES:
        others = [levels for levels in others if levels.number is not None]
    choices = [range(len(levels)) if levels.number is None else [(len(levels) - 1) // 2] for levels in others]
    return [
        Slice(
            ", ".join(f"{levels.path} {levels.labels[at]}" for levels, at in zip(others, place, strict=True)),
            ", ".join(levels.labels[at] for levels, at in zip(others, place, strict=True)),
            frozenset(whole.cell(*zip(others, place, strict=True))),
        )
        for place in product(*choices)
    ]
