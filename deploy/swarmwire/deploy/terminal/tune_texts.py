"""What a tuning's goal came to, as people read it."""

import math

import numpy as np

from swarmwire.deploy.tuning.goal import SHARES, Goal
from swarmwire.deploy.tuning.study import Trial
from swarmwire.metrics.statistics.bootstrap import binomial_interval
from swarmwire.metrics.statistics.sample import UNKNOWN, Interval, Sample
from swarmwire.metrics.statistics.summary import interval_text, quantile_text, summary
from swarmwire.metrics.statistics.survival import kaplan_meier
from swarmwire.metrics.text import UNKNOWN_TEXT, number_text


def statistic_text(trial: Trial, goal: Goal) -> str:
    """Of a trial on its seeds: a number with its unit, or `> 60 s`."""
    statistic = trial.result.statistic
    if trial.result.value is None:
        return UNKNOWN_TEXT
    return with_unit(quantile_text(math.nan if statistic is None else statistic, goal.limit_s), goal)


def sample_text(sample: Sample, goal: Goal) -> str:
    """Of other runs, with the interval where there is one."""
    reached = goal.reached(sample)
    if not len(sample):
        return UNKNOWN_TEXT
    text = with_unit(quantile_text(reached.statistic, goal.limit_s), goal)
    interval = interval_text(_interval(sample, goal))
    return text if interval == UNKNOWN_TEXT else f"{text} ({interval})"


def with_unit(text: str, goal: Goal) -> str:
    """A number of the goal's statistic with its unit; a share has none."""
    return text if goal.stat == "censored" or not goal.response.unit else f"{text} {goal.response.unit}"


def _interval(sample: Sample, goal: Goal) -> Interval:
    if goal.stat == "censored":
        low, high = binomial_interval(np.array([np.count_nonzero(~sample.observed)]), np.array([len(sample)]))
        return Interval(float(low[0]), float(high[0]))
    of = summary(sample)
    if goal.stat == "mean":
        return of.mean_interval
    if goal.stat == "q50":
        return of.q50_interval
    return kaplan_meier(sample).quantile_interval(SHARES[goal.stat]) if sample.kind == "time" else UNKNOWN


def parameter_text(value: object) -> str:
    """A parameter: all its digits are in best.toml.

    >>> parameter_text(0.123456789), parameter_text(12), parameter_text("discs")
    ('0.12346', '12', 'discs')
    """
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def failed_text(failed: int) -> str:
    """How many runs failed, in brackets, or nothing.

    >>> failed_text(0), failed_text(2)
    ('', ', 2 failed')
    """
    return f", {failed} failed" if failed else ""


def difference_text(of: float, interval: Interval) -> str:
    """A difference with its interval, signed.

    >>> difference_text(-1.5, Interval(-2.0, -1.0))
    '-1.5 (-2 to -1)'
    """
    return f"{number_text(of, sign=True)} ({interval_text(interval, sign=True)})"
