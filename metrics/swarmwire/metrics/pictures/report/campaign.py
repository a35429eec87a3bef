"""The report of a campaign: the choice of responses, the summary, the methods, and all sections in order."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from swarmwire.metrics.pictures.report.campaign_data import (
    Rounding,
    Samples,
    response_title,
    rounding_of,
    short_value,
)
from swarmwire.metrics.pictures.report.campaign_models import resilience_section, scaling_section
from swarmwire.metrics.pictures.report.campaign_overview import distribution_section, setup_section
from swarmwire.metrics.pictures.report.campaign_survival import survival_section
from swarmwire.metrics.pictures.report.campaign_transitions import transition_section
from swarmwire.metrics.pictures.report.page import Report, ReportTable, Section
from swarmwire.metrics.records.campaign.folder import CampaignFolder
from swarmwire.metrics.records.campaign.spec import FAILED, Response, find_response
from swarmwire.metrics.statistics.bootstrap import MIN_RESAMPLES, RESAMPLES
from swarmwire.metrics.statistics.summary import Summary
from swarmwire.metrics.text import counted, listed, number_text, sentence

MOST = 8
PREFERRED = (
    "stop_time_s",
    "target_best.final",
    "target_mean.final",
    "order.final",
    "largest_component.final",
    "radio.link_pdr",
)
MAX_POINTS = 60  # beyond which tables are by the values of each parameter
_MAX_OPEN_ROWS = 20  # of tables after the first that are not folded
_ALWAYS = (
    "Values. Quartiles of numbers are interpolated linearly (Hyndman and Fan, The American Statistician 50, 1996, "
    "type 7). Intervals hold with 95 % confidence; those of medians and means of numbers, and of all statistics over "
    "several design points, are expanded bootstrap percentiles over seeds "
    f"({RESAMPLES:,} resamples, down to {MIN_RESAMPLES:,} of very large samples; Efron, Annals of Statistics 7, 1979; "
    "Field and Welsh, Journal of the Royal Statistical Society B 69, 2007; Hesterberg, The American Statistician 69, "
    "2015). A seed that is drawn brings its runs of all design points. Draws are keyed, so that the same data give the "
    "same intervals.",
)
_OF_SECTIONS = {
    "times": (
        "Times. A run that ended before something happened is right-censored at its end, or earlier by as long as "
        "something must hold to count, since what began later could not be known. Quartiles of times are "
        "those of Kaplan and Meier's estimate (Journal of the American Statistical Association 53, 1958), their "
        "intervals Brookmeyer and Crowley's (Biometrics 38, 1982) with the log-log band; where the estimate does "
        "not come down to a quartile it is beyond the limit, and so said (>). Ticks on curves are censored runs. "
        'Runs in the column "stopped first" were ended by a stop condition before the event. The estimate treats '
        "them as censored by chance. If the condition has to do with the event, it misleads: run again with "
        "`keep_running = true` in `[stop]`. Where runs stop early, values at the end and sums are of runs of different "
        "lengths."
    ),
    "Survival": (
        "Shares of runs. Intervals are Wilson's score intervals (Journal of the American Statistical Association 22, "
        "1927)."
    ),
    "Transitions": (
        "Change points. Of all ways to divide the ordered values of a parameter in two, the one with the least sum "
        "of squares of all runs around two means (Hinkley, Biometrika 57, 1970), where the BIC is lower than those "
        "of one mean and of a straight line. Its place is halfway between two values that were run; intervals are "
        "bootstrap percentiles "
        "over seeds, given that there is a step, and never finer than the values that were run."
    ),
    "Resilience": (
        "Resilience. a + b f and a exp(b f) are fitted by least squares to all runs at loss f, relative to the mean "
        "at the least loss; intervals resample seeds, and so include the error of that mean. AIC = n ln(RSS / n) + "
        "2 · 3, and a difference of less than 2 says little (Burnham and Anderson, Model Selection, 2002). A "
        "change point whose AIC, with 2 · 4, is lower by 2 is named instead: a step. R² below 0.5 explains little."
    ),
    "Scaling": (
        "Scaling. Karp and Flatt's fraction e = (1/X − 1/s) / (1 − 1/s) of speed-up X with s times as many robots "
        "(Communications of the ACM 33, 1990), as used of swarms by Harwell and Gini (arXiv 1907.03880). Times are "
        "means of min(time, h) by Kaplan and Meier's estimate, where h is the time up to which every run of every "
        "size was observed. Intervals resample seeds, of all sizes together."
    ),
}


@dataclass(frozen=True)
class ChosenResponses:
    """The responses of a campaign, sorted out."""

    shown: tuple[Response, ...]
    others: tuple[Response, ...]  # that vary, too
    constant: tuple[Response, ...]  # one value in all runs
    never: tuple[Response, ...]  # no value in any


def choose_responses(samples: Samples, names: Sequence[str]) -> ChosenResponses:
    """The responses of these names; without names at most MOST: times, then final values and the link PDR.

    BadInput for an unknown name.
    """
    known = samples.responses
    named = tuple(dict.fromkeys(find_response(name, known) for name in names))
    never = tuple(response for response in known if response not in named and not samples.all(response).observed.any())
    there = [response for response in known if response not in never]
    constant = tuple(response for response in there if response not in named and not _varies(samples, response))
    vary = [response for response in there if response not in constant]
    usual = sorted((response for response in vary if response.is_usual), key=_rank)
    shown = named or tuple((usual or vary)[:MOST])
    return ChosenResponses(shown, tuple(response for response in vary if response not in shown), constant, never)


def _varies(samples: Samples, response: Response) -> bool:
    sample = samples.all(response)
    return bool(sample.value.min() < sample.value.max() or not sample.observed.all())


def _rank(response: Response) -> tuple[bool, bool, int]:
    """Sort key: times, then the scenario's metrics, then the preferred ones; others keep the campaign's order."""
    place = PREFERRED.index(response.column) if response.column in PREFERRED else len(PREFERRED)
    return response.kind != "time", not response.listed, place


@dataclass(frozen=True)
class _Group:
    """A row of each table: its first cells, and the design points that it is about."""

    cells: tuple[str, ...]
    points: tuple[int, ...]


def summary_section(samples: Samples, chosen: ChosenResponses) -> Section:
    """The section."""
    columns, groups = _groups(samples)
    parts: list[str | ReportTable] = []
    if len(samples.folder.points) > MAX_POINTS:
        parts.append(
            f"There are {len(samples.folder.points):,} design points, so the tables are by the values of each "
            "parameter, over all values of the others. Quartiles are those of all these runs. Intervals are about "
            "other seeds at the same design points: whole seeds are resampled, so they do not shrink with the number "
            "of points. `summary.parquet` has every run."
        )
    for place, response in enumerate(chosen.shown):
        folded = place > 0 and len(groups) > _MAX_OPEN_ROWS
        parts.append(_table(samples, response, columns, groups, folded=folded))
    for what, responses in (
        ("The same in all runs that have a value", chosen.constant),
        ("Never there in any run", chosen.never),
    ):
        if responses:
            parts.append(f"{what}, and so left out: {listed([f'`{response.column}`' for response in responses])}.")
    if chosen.others:
        parts.append(_other_table(samples, chosen.others, columns, groups))
    return Section("Summary", tuple(parts))


def _groups(samples: Samples) -> tuple[tuple[str, ...], list[_Group]]:
    """The names of the first columns, and the rows."""
    points, parameters = samples.folder.points, samples.folder.parameters
    if len(points) <= MAX_POINTS:
        rows = [
            _Group(tuple(short_value(point[path]) for path in parameters), (number,))
            for number, point in enumerate(points)
        ]
        return parameters, rows
    rows: list[_Group] = []
    for path in parameters:
        levels = samples.levels(path)
        rows += [_Group((path, label), tuple(levels.points(level))) for level, label in enumerate(levels.labels)]
    return ("parameter", "value"), rows


def _table(
    samples: Samples, response: Response, columns: tuple[str, ...], groups: list[_Group], *, folded: bool
) -> ReportTable:
    summaries = [samples.summary(response, group.points) for group in groups]
    rounding = _rounding(summaries)
    some_undefined = any(found.undefined for found in summaries)
    pooled = any(found.seeds < found.n for found in summaries)
    some_stopped = any(found.stopped_first for found in summaries)
    header = [*columns, *(["runs", "seeds"] if pooled else ["n"]), "median", "quartiles", "95 % interval of the median"]
    header += ["not reached"] if response.kind == "time" else []
    header += ["stopped first"] if some_stopped else []
    header += ["undefined"] if some_undefined else []
    rows = [
        (
            *group.cells,
            str(found.n),
            *([str(found.seeds)] if pooled else []),
            *_figures(found, response, rounding),
            *([_share(found)] if response.kind == "time" else []),
            *([_stopped_first(found)] if some_stopped else []),
            *([str(found.undefined)] if some_undefined else []),
        )
        for group, found in zip(groups, summaries, strict=True)
    ]
    what = f"{sentence(response_title(response))} (`{response.column}`): {response.help.rstrip('.')}."
    return ReportTable(tuple(header), tuple(rows), what, folded=folded)


def _other_table(
    samples: Samples, responses: tuple[Response, ...], columns: tuple[str, ...], groups: list[_Group]
) -> ReportTable:
    rows: list[tuple[str, ...]] = []
    for response in responses:
        summaries = [samples.summary(response, group.points) for group in groups]
        rounding = _rounding(summaries)
        rows += [
            (response.column, *group.cells, str(found.n), *_figures(found, response, rounding)[:2], _share(found))
            for group, found in zip(groups, summaries, strict=True)
        ]
    header = ("response", *columns, "n", "median", "quartiles", "not reached")
    return ReportTable(header, tuple(rows), f"The other responses ({len(responses)})", folded=True)


def _figures(found: Summary, response: Response, rounding: Rounding) -> tuple[str, str, str]:
    """Median, quartiles and the median's interval."""
    # With its own digits: rounded like the quartiles, 2.6 s might read > 3 s, which is not known.
    beyond = f"> {number_text(found.limit)}{' ' + response.unit if response.unit else ''}"
    censored = response.kind == "time" and found.n > 0

    def text(value: float) -> str:
        return beyond if censored and not math.isfinite(value) else rounding.text(value)

    low, high = found.q50_interval
    return (
        text(found.q50),
        _span(text(found.q25), text(found.q75)),
        _span(text(low), text(high)),
    )


def _span(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"


def _share(found: Summary) -> str:
    return f"{100.0 * found.censored:.0f} %" if math.isfinite(found.censored) else "–"


def _stopped_first(found: Summary) -> str:
    """Runs that a stop condition ended before the time, and the shortest observation of these."""
    return f"{found.stopped_first} of {found.n}, from {number_text(found.shortest)} s" if found.stopped_first else "–"


def _rounding(summaries: Sequence[Summary]) -> Rounding:
    return rounding_of(
        [value for found in summaries for value in (found.q25, found.q50, found.q75)],
        [found.q75 - found.q25 for found in summaries],
    )


def methods_section(sections: Collection[str], *, times: bool) -> Section:
    """The section, for the titles of the report's sections; `times`: whether any response is a time."""
    there = {*sections, *(["times"] if times else [])}
    return Section("Methods", (*_ALWAYS, *(text for title, text in _OF_SECTIONS.items() if title in there)))


def campaign_report(
    folder: CampaignFolder, responses: Sequence[str] = (), labels: Mapping[str, str] | None = None
) -> Report:
    """The report of a campaign, finished or not, on these responses, by default the most informative ones.

    `labels` are texts for parameters and responses in figures and captions. BadInput for an unknown response or
    parameter, or a damaged file.
    """
    samples = Samples(folder, labels)
    chosen = choose_responses(samples, responses)
    times = tuple(response for response in chosen.shown if response.kind == "time")
    found: list[Section | None] = []
    if len(folder.runs):
        found = [
            transition_section(samples, chosen.shown),
            survival_section(samples, times),
            distribution_section(samples, chosen.shown),
            summary_section(samples, chosen),
            resilience_section(samples, chosen.shown),
            scaling_section(samples, times),
        ]
    sections = [section for section in found if section is not None]
    methods = methods_section([section.title for section in sections], times=bool(times))
    failed = int((folder.runs["ended"] == FAILED).sum())
    problems = [f"{count:,} {what}" for count, what in ((failed, "failed"), (len(folder.missing), "missing")) if count]
    about = ", ".join(
        [f"{counted(len(folder.runs), 'run')} of {counted(len(folder.points), 'design point')}", *problems]
    )
    return Report(folder.about.name, (*sections, setup_section(folder), methods), about)
