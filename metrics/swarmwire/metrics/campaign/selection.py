"""Part of a campaign: the design points at which some parameters have one value, as `FOLDER@radio.loss=0.4`."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.campaign.point_values import same_value, value_from, value_text


@dataclass(frozen=True)
class Selection:
    """Points of a campaign, by their numbers."""

    text: str  # as it was asked for
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
