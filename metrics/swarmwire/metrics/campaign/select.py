"""Parts of campaigns, as `FOLDER@radio.loss=0.4` names them, and which points of two parts are compared."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.folder import CampaignFolder
from swarmwire.metrics.campaign.spec import point_text, same_value, value_from, value_text


@dataclass(frozen=True)
class Selection:
    """Points of a campaign, by their numbers."""

    text: str  # FOLDER@path=value, for messages
    campaign: CampaignFolder
    points: tuple[int, ...]
    pinned: frozenset[str]  # parameters of which one value was chosen


def select(text: str) -> Selection:
    """What `FOLDER` or `FOLDER@path=value@path=value` names; BadInput if there is no such folder, path or value."""
    folder, *settings = [text] if Path(text).exists() else text.split("@")
    campaign = CampaignFolder(folder)
    points = range(len(campaign.points))
    paths: list[str] = []
    for setting in settings:
        path, chosen = _setting(setting, text)
        if path not in campaign.parameters:
            raise BadInput(
                text, path, f"expected a parameter that was varied: {did_you_mean(campaign.parameters, path)}"
            )
        points = points_at(campaign, points, path, chosen, text)
        paths.append(path)
    return Selection(text, campaign, tuple(points), frozenset(paths))


def at(selections: Sequence[Selection], settings: Sequence[str]) -> tuple[Selection, ...]:
    """Of each selection the points with these values ("path=value"), as far as it varies them.

    BadInput for a path that none of them varies, and a value that one of them lacks.
    """
    for setting in settings:
        path, chosen = _setting(setting, "--at")
        known = sorted({path for of in selections for path in of.campaign.parameters})
        if path not in known:
            raise BadInput("--at", path, f"expected a parameter that was varied: {did_you_mean(known, path)}")
        selections = [
            Selection(of.text, of.campaign, tuple(points_at(of.campaign, of.points, path, chosen, of.text)), of.pinned)
            if path in of.campaign.parameters
            else of
            for of in selections
        ]
    return tuple(selections)


def points_at(campaign: CampaignFolder, points: Sequence[int], path: str, text: str, where: str) -> list[int]:
    """Those of the points at which a parameter has the value that a person wrote; BadInput names those that it has."""
    value = value_from(text)
    found = [point for point in points if same_value(campaign.points[point][path], value)]
    if not found:
        known = dict.fromkeys(value_text(campaign.points[point][path]) for point in points)
        raise BadInput(where, path, f"expected {did_you_mean(known)}, got {text}")
    return found


def _setting(setting: str, where: str) -> tuple[str, str]:
    path, equals, value = (part.strip() for part in setting.partition("="))
    if not (path and equals and value):
        raise BadInput(where, setting, "expected path=value, such as radio.loss=0.4")
    return path, value


class PointPair(NamedTuple):
    """Numbers of two points."""

    first: int
    second: int


def shared_paths(first: Selection, second: Selection) -> tuple[str, ...]:
    """Parameters that must agree: both vary them, and for neither one value was chosen."""
    free = set(second.campaign.parameters) - first.pinned - second.pinned
    return tuple(path for path in first.campaign.parameters if path in free)


def point_pairs(first: Selection, second: Selection) -> list[PointPair]:
    """Points that agree in what both vary, in the first's order.

    BadInput if there are none, or if their pairs are ambiguous.
    """
    paths = shared_paths(first, second)
    if not paths and len(first.points) > 1 and len(second.points) > 1:
        expected = f"expected a parameter that both vary: {_paths(first)} and {_paths(second)}; choose points with @"
        raise BadInput(_both(first, second), "", expected)
    pairs = [
        PointPair(one, other)
        for one in first.points
        for other in second.points
        if all(same_value(first.campaign.points[one][path], second.campaign.points[other][path]) for path in paths)
    ]
    if not pairs:
        expected = f"expected design points in common: {_example(first, paths)} and {_example(second, paths)}"
        raise BadInput(_both(first, second), "", expected)
    return pairs


def _both(first: Selection, second: Selection) -> str:
    return f"{first.text}, {second.text}"


def _paths(of: Selection) -> str:
    return f"one varies {', '.join(of.campaign.parameters)}"


def _example(of: Selection, paths: tuple[str, ...]) -> str:
    first = point_text(of.campaign.points[of.points[0]], paths)
    return f"one has {first}" + (f" and {len(of.points) - 1} others" if len(of.points) > 1 else "")
