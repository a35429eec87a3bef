"""The section of survival curves: how long things take, with the runs in which they never came."""

from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.report.campaign.figure_name import figure_name
from swarmwire.metrics.report.campaign.levels import Levels, levels_of
from swarmwire.metrics.report.campaign.samples import Samples
from swarmwire.metrics.report.campaign.words import response_title, sentence
from swarmwire.metrics.report.figures.survival_curves import SurvivalCurve, survival_curves
from swarmwire.metrics.report.section import Figure, Section
from swarmwire.metrics.report.svg import as_svg
from swarmwire.metrics.statistics.survival import kaplan_meier

MAX_CURVES = 6
_MAX_PARAMETERS = 2


def survival_section(samples: Samples, times: tuple[Response, ...]) -> Section | None:
    """The section; None if there is no time."""
    levels = [levels_of(path, samples.folder.points) for path in samples.folder.parameters[:_MAX_PARAMETERS]]
    levels = [each for each in levels if len(each) > 1] or [None]
    figures = [_figure(samples, response, each) for response in times for each in levels]
    if not figures:
        return None
    text = (
        "The share of runs in which it has not happened yet, by Kaplan and Meier's estimate. A curve falls with "
        "each run in which it happens; a tick on it is a run that ended before."
    )
    return Section("Survival", (text, *figures))


def _figure(samples: Samples, response: Response, levels: Levels | None) -> Figure:
    title = response_title(response)
    if levels is None:
        name = figure_name("survival", response.column)
        everything = tuple(range(len(samples.folder.points)))
        curves = [_curve(samples, response, "all runs", everything)]
        return Figure(name, as_svg(survival_curves(curves, "share still waiting", title), name), f"{title}.")
    name = figure_name("survival", response.column, levels.path)
    last, count = len(levels) - 1, min(MAX_CURVES, len(levels))
    shown = [round(last * turn / (count - 1)) for turn in range(count)]
    curves = [_curve(samples, response, levels.short[level], tuple(levels.points(level))) for level in shown]
    drawn = survival_curves(curves, f"share still waiting, by {levels.path}", title)
    some = f", {len(shown)} of its {len(levels)} values" if len(shown) < len(levels) else ""
    pooled = ", over all values of the others" if len(samples.folder.parameters) > 1 else ""
    return Figure(name, as_svg(drawn, name), f"{sentence(title)} by `{levels.path}`{some}{pooled}.")


def _curve(samples: Samples, response: Response, label: str, points: tuple[int, ...]) -> SurvivalCurve:
    sample = samples.sample(response, points)
    estimate = kaplan_meier(sample)
    cut_off = sample.value[~sample.observed]
    end_s = float(sample.value.max()) if len(sample) else 0.0
    return SurvivalCurve(label, estimate.time, estimate.survival, cut_off, end_s)
