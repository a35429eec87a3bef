"""One trial of a tuning: the parameters that were tried, and what came of all seeds with them."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from swarmwire.deploy.tuning.search import Parameter

State = Literal["running", "complete", "failed"]  # running: under way, or it was when the tuning was ended

WHEN = "in tick "  # so begins the line below a traceback that says when in the run it was


@dataclass(frozen=True)
class TrialResult:
    """What a trial that is over came to."""

    value: float | None = None  # that Optuna was given; None: it failed
    statistic: float | None = None  # of the goal; None of a quantile of times beyond the limit
    censored: float = 0.0  # share of the runs
    undefined: int = 0  # runs with nothing to measure
    failed: int = 0  # runs that failed: then the trial did
    error: str = ""  # of the first of these, or why there is no value

    def attributes(self) -> dict[str, Any]:
        """All but the value, by name."""
        return {name: of for name, of in asdict(self).items() if name != "value"}


@dataclass(frozen=True)
class Trial:
    """A trial; its number is the same as Optuna's."""

    number: int
    parameters: Mapping[str, Parameter]  # by path; of choices the text
    state: State
    result: TrialResult

    @property
    def is_over(self) -> bool:
        """Whether it ended, well or not."""
        return self.state != "running"

    @property
    def why(self) -> str:
        """Its error in a line: what was raised, without where."""
        lines = self.result.error.strip().splitlines()
        if len(lines) > 1 and lines[-1].startswith(WHEN):
            return f"{lines[-2]}, {lines[-1]}"
        return lines[-1] if lines else ""
