"""Names of statistics, as people write them: `order`, `order.final.q50`, `aggregation_time_s.censored`."""

from collections.abc import Iterable
from typing import Literal, NamedTuple, get_args

from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.response import FINAL, Response

Stat = Literal["q25", "q50", "q75", "mean", "censored"]  # quartiles, mean, and the share that was cut off
STATS: tuple[Stat, ...] = get_args(Stat)
USUAL: Stat = "q50"


class Statistic(NamedTuple):
    """One number of the runs of a point: which response, and what of its values."""

    response: Response
    stat: Stat

    @property
    def name(self) -> str:
        """As `statistic` reads it."""
        return f"{self.response.column}.{self.stat}"


def find_response(name: str, responses: Iterable[Response], where: str = "--response") -> Response:
    """The response of this column; the bare name of a metric means its last value. BadInput if there is none."""
    known = {response.column: response for response in responses}
    found = known.get(name) or known.get(name + FINAL)
    if found is None:
        raise BadInput(where, name, f"expected {did_you_mean(known, name)}")
    return found


def find_statistic(name: str, responses: Iterable[Response], where: str = "--response") -> Statistic:
    """The statistic that `COLUMN.STAT` names; the median if it names a column alone.

    Where a column itself ends like a statistic (order.mean) it is that column. BadInput for what there is not, and for
    the censored share of what is no time.
    """
    known = {response.column: response for response in responses}
    column, _, last = name.rpartition(".")
    stat: Stat | None = STATS[STATS.index(last)] if last in STATS else None
    if name in known or stat is None or not column:
        return Statistic(find_response(name, known.values(), where), USUAL)
    found = find_response(column, known.values(), where)
    if stat == "censored" and found.kind != "time":
        raise BadInput(where, name, "expected a time: of a number nothing is censored")
    return Statistic(found, stat)
