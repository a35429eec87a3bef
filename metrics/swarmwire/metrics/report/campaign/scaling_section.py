"""The section of scaling: what more robots bring."""

import re

import numpy as np

from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.report.campaign.figure_name import figure_name
from swarmwire.metrics.report.campaign.levels import Levels, levels_of
from swarmwire.metrics.report.campaign.rounding import Rounding, rounding_of
from swarmwire.metrics.report.campaign.samples import Samples
from swarmwire.metrics.report.campaign.words import response_title
from swarmwire.metrics.report.figures.scaling_curve import scaling_curve
from swarmwire.metrics.report.section import Figure, Section, Table
from swarmwire.metrics.report.svg import as_svg
from swarmwire.metrics.statistics.trends import Scaling, scaling

_COUNT = re.compile(r"robots\.[^.]+\.count")


def scaling_section(samples: Samples, times: tuple[Response, ...]) -> Section | None:
    """The section; None unless a number of robots is varied and a time was measured."""
    parts: list[Figure | Table] = []
    for levels in (levels_of(path, samples.folder.points) for path in samples.folder.parameters):
        if not _COUNT.fullmatch(levels.path) or levels.number is None or len(levels) < 2 or levels.number[0] <= 0.0:
            continue
        for response in times:
            parts += _parts(samples, response, levels)
    if not parts:
        return None
    text = (
        "Speed-up X is the mean time of the smallest swarm over that of N robots, a run that was cut off counting "
        "with the time until then; efficiency is X per robot, 1 where each does as much as one of the smallest "
        "swarm (dashed). The serial fraction of Karp and Flatt is the share of the work that does not gain from "
        "more robots: 0 at best, 1 if they gain nothing, more if they are in one another's way."
    )
    return Section("Scaling", (text, *parts))


def _parts(samples: Samples, response: Response, levels: Levels) -> list[Figure | Table]:
    assert levels.number is not None
    means = np.array([samples.summary(response, tuple(levels.points(level))).mean for level in range(len(levels))])
    if not np.isfinite(means).any() or not means[0] > 0.0:
        return []
    found = scaling(levels.number, means, is_time=True)
    figures: list[Figure | Table] = []
    kinds = (("efficiency", found.efficiency, 1.0), ("serial fraction", found.serial_fraction, 0.0))
    for what, value, level in kinds:
        name = figure_name(what, response.column, levels.path)
        drawn = scaling_curve(levels.number, value, what, level)
        figures.append(
            Figure(name, as_svg(drawn, name), f"{what.capitalize()} of {response_title(response)}, `{levels.path}`.")
        )
    return [*figures, _table(response, levels, means.tolist(), found)]


def _table(response: Response, levels: Levels, means: list[float], found: Scaling) -> Table:
    rounded = rounding_of(means).text
    rows = tuple(
        (label, rounded(mean), *map(Rounding(3).text, values))
        for label, mean, *values in zip(
            levels.labels, means, found.speed_up, found.efficiency, found.serial_fraction, strict=True
        )
    )
    header = (levels.path, f"mean time in {response.unit}", "speed-up", "efficiency", "serial fraction")
    return Table(header, rows, f"Scaling of {response_title(response)}")
