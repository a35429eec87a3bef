"""The section of distributions: each response by the values of each parameter."""

from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.report.campaign.figure_name import figure_name
from swarmwire.metrics.report.campaign.levels import Levels, levels_of
from swarmwire.metrics.report.campaign.samples import Samples
from swarmwire.metrics.report.campaign.words import listed, response_title, sentence
from swarmwire.metrics.report.figures.distributions import MAX_POINTS, Group, distributions
from swarmwire.metrics.report.section import Figure, Section
from swarmwire.metrics.report.svg import as_svg

MAX_PARAMETERS = 3


def distribution_section(samples: Samples, responses: tuple[Response, ...]) -> Section | None:
    """The section; None if nothing is varied or nothing was measured."""
    parameters = samples.folder.parameters
    levels = [levels_of(path, samples.folder.points) for path in parameters[:MAX_PARAMETERS]]
    levels = [each for each in levels if len(each) > 1]
    figures = [_figure(samples, response, each) for response in responses for each in levels]
    if not figures:
        return None
    parts: list[str | Figure] = [_how_to_read(samples, responses, levels)]
    left_out = parameters[MAX_PARAMETERS:]
    if left_out:
        parts.append(
            f"By the first {MAX_PARAMETERS} parameters; left out: {listed([f'`{path}`' for path in left_out])}."
        )
    return Section("Distributions", (*parts, *figures))


def _how_to_read(samples: Samples, responses: tuple[Response, ...], levels: list[Levels]) -> str:
    text = (
        f"Dots are runs; where groups have more than {MAX_POINTS}, the blue shape is their density. The box reaches "
        "from the lower to the upper quartile, the bar is the median."
    )
    if any(samples.limit(response) is not None for response in responses):
        text += (
            " The dashed line is the time limit, the number above it the share of runs that reached it; a box that "
            "is open at the top has its upper quartile beyond."
        )
    if any(each.means for each in levels):
        text += (
            " Parameters of many values are put together into ranges, equally full, which figures call by their means."
        )
    return text


def _figure(samples: Samples, response: Response, levels: Levels) -> Figure:
    name = figure_name("distribution", response.column, levels.path)
    limit = samples.limit(response)
    groups = [_group(samples, response, levels, level) for level in range(len(levels))]
    figure = distributions(groups, response_title(response), levels.path, limit)
    pooled = " over all values of the others" if len(samples.folder.parameters) > 1 else ""
    caption = f"{sentence(response_title(response))} by `{levels.path}`{pooled}."
    return Figure(name, as_svg(figure, name), caption)


def _group(samples: Samples, response: Response, levels: Levels, level: int) -> Group:
    points = tuple(levels.points(level))
    sample = samples.sample(response, points)
    censored = sample.censored if len(sample) else 0.0
    return Group(levels.short[level], sample.value[sample.observed], censored, samples.quartiles(response, points))
