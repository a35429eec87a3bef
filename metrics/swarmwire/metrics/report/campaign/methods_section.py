"""The section that says how the numbers were made, for the methods of a paper."""

from collections.abc import Collection

from swarmwire.metrics.report.section import Section
from swarmwire.metrics.statistics.bootstrap import MIN_RESAMPLES, RESAMPLES

_ALWAYS = (
    "Values. Quartiles of numbers are interpolated linearly (Hyndman and Fan, The American Statistician 50, 1996, "
    "type 7). Intervals hold with 95 % confidence; those of medians and means of numbers are expanded bootstrap "
    f"percentiles ({RESAMPLES:,} resamples, down to {MIN_RESAMPLES:,} of very large samples; Efron, Annals of "
    "Statistics 7, 1979; Hesterberg, The American Statistician 69, 2015). Draws are keyed, so that the same data "
    "give the same intervals.",
)
_OF_SECTIONS = {
    "times": (
        "Times. A run that ended before something happened is right-censored at its end, or earlier by as long as "
        "something must hold to count, since what began later could not be known. Quartiles of times are "
        "those of Kaplan and Meier's estimate (Journal of the American Statistical Association 53, 1958), their "
        "intervals Brookmeyer and Crowley's (Biometrics 38, 1982) with the log-log band; where the estimate does "
        "not come down to a quartile it is beyond the limit, and so said (>). Ticks on curves are censored runs. "
        "Where runs stop early, values at the end and sums are of runs of different lengths: what stopped them is "
        "selected."
    ),
    "Transitions": (
        "Change points. Of all ways to divide the ordered values of a parameter in two, the one with the least sum "
        "of squares of all runs around two means (Hinkley, Biometrika 57, 1970), where the BIC is lower than that "
        "of one mean. Its place is halfway between two values that were run; intervals are bootstrap percentiles "
        "over seeds, given that there is a step, and never finer than the values that were run."
    ),
    "Resilience": (
        "Resilience. a + b f and a exp(b f) are fitted by least squares to all runs at loss f, relative to the mean "
        "at the least loss; AIC = n ln(RSS / n) + 2 · 3, and a difference of less than 2 says little (Burnham and "
        "Anderson, Model Selection, 2002)."
    ),
    "Scaling": (
        "Scaling. Karp and Flatt's fraction e = (1/X − 1/s) / (1 − 1/s) of speed-up X with s times as many robots "
        "(Communications of the ACM 33, 1990), as used of swarms by Harwell and Gini (arXiv 1907.03880)."
    ),
}


def methods_section(sections: Collection[str], *, times: bool) -> Section:
    """The section, about what the report has: the titles of its sections, and whether any response is a time."""
    there = {*sections, *(["times"] if times else [])}
    return Section("Methods", (*_ALWAYS, *(text for title, text in _OF_SECTIONS.items() if title in there)))
