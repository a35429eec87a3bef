"""Samples of a campaign and what they come to, of one design point or of several together, worked out once."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray
from swarmwire.metrics.campaign.campaign_folder import CampaignFolder
from swarmwire.metrics.campaign.response import Response
from swarmwire.metrics.statistics.sample import Sample, by_seed
from swarmwire.metrics.statistics.summary import Summary, summary
from swarmwire.metrics.statistics.survival import kaplan_meier

_NOTHING = Sample(np.empty(0), np.empty(0, np.bool_), np.empty(0, np.int64))


class Samples:
    """What the sections of a report ask a campaign for. `points` are numbers of design points."""

    def __init__(self, folder: CampaignFolder) -> None:
        self.folder = folder
        self._of_point = lru_cache(maxsize=None)(folder.sample)
        self._summary = lru_cache(maxsize=None)(self._new_summary)

    def sample(self, response: Response, points: tuple[int, ...]) -> Sample:
        """The values of all runs of these points."""
        parts = [self._of_point(response.column, point) for point in points]
        if len(parts) == 1:
            return parts[0]
        return Sample(
            np.concatenate([part.value for part in parts] or [np.empty(0)]),
            np.concatenate([part.observed for part in parts] or [np.empty(0, np.bool_)]),
            np.concatenate([part.seed for part in parts] or [np.empty(0, np.int64)]),
            kind=response.kind,
            failed=sum(part.failed for part in parts),
            undefined=sum(part.undefined for part in parts),
        )

    def all(self, response: Response) -> Sample:
        """The values of all runs."""
        return self.sample(response, tuple(range(len(self.folder.points))))

    def table(self, response: Response, rows: Sequence[tuple[int, ...]]) -> FloatArray:
        """Values (rows, runs), of the points of each row; a seed keeps its column, NaN where there is no value.

        A time that was cut off counts as the time until then.
        """
        return _side_by_side([[self._of_point(response.column, point) for point in points] for points in rows])

    def reached(self, response: Response, rows: Sequence[tuple[int, ...]]) -> BoolArray:
        """Of the same shape: whether the value was observed, not cut off."""
        found = [[self._of_point(response.column, point) for point in points] for points in rows]
        whether = [[replace(sample, value=sample.observed.astype(np.float64)) for sample in row] for row in found]
        return _side_by_side(whether) == 1.0

    def summary(self, response: Response, points: tuple[int, ...]) -> Summary:
        """What these runs come to."""
        return self._summary(response, points)

    def quartiles(self, response: Response, points: tuple[int, ...]) -> tuple[float, float, float]:
        """A quarter, half and three quarters of the runs; inf: beyond the limit, NaN: there is no value."""
        sample = self.sample(response, points)
        if not len(sample):
            return (np.nan, np.nan, np.nan)
        if response.kind == "time":
            curve = kaplan_meier(sample)
            found = [curve.quantile(share) for share in (0.25, 0.5, 0.75)]
            return tuple(np.nan_to_num(found, nan=np.inf).tolist())
        return tuple(np.quantile(sample.value, (0.25, 0.5, 0.75)).tolist())

    def limit(self, response: Response) -> float | None:
        """Up to where the longest run that was cut off was followed; None: none was."""
        sample = self.all(response)
        cut_off = sample.value[~sample.observed]
        return float(cut_off.max()) if len(cut_off) else None

    def _new_summary(self, response: Response, points: tuple[int, ...]) -> Summary:
        return summary(self.sample(response, points))


def _side_by_side(rows: Sequence[Sequence[Sample]]) -> FloatArray:
    """Values (rows, runs): those of the first point of each row seed by seed, then those of the second, and so on."""
    turns = max(map(len, rows), default=0)
    blocks = [by_seed([row[turn] if turn < len(row) else _NOTHING for row in rows]) for turn in range(turns)]
    return np.concatenate([np.empty((len(rows), 0)), *blocks], axis=1)
