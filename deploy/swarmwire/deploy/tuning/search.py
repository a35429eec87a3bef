"""What a tuning searches: a path of the scenario, and the range or the choices among which the best is looked for."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import floor
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.campaign.toml_value import toml_value
from swarmwire.deploy.campaign.vary import EXPECTED as OF_VARY
from swarmwire.deploy.campaign.vary import Range, Vary, vary_of
from swarmwire.metrics.campaign.point_values import value_text

EXPECTED = "expected PATH=LOW:HIGH, such as radio.range_m=1:5, with :log for equal ratios, or choices: PATH=a,b,c"
Parameter = int | float | str  # as Optuna knows it: of choices the text


@dataclass(frozen=True)
class Search:
    """One path that is searched: choices, or where there are none the numbers from low to high, both ends included."""

    path: str
    low: float = 0.0
    high: float = 0.0
    whole: bool = False
    log: bool = False  # in equal ratios
    choices: tuple[Any, ...] = ()
    overrides: tuple[str, ...] = ()  # of each choice, for the scenario in the tuning's folder, whose files are copies

    @property
    def names(self) -> tuple[str, ...]:
        """The choices as texts, by which Optuna knows them."""
        return tuple(value_text(choice) for choice in self.choices)

    @property
    def trials(self) -> tuple[Any, ...]:
        """Values that must be fit for the scenario: all choices, or both ends."""
        return self.choices or (self._number(self.low), self._number(self.high))

    def value(self, parameter: Parameter) -> Any:
        """The scenario's value that a parameter stands for."""
        return self.choices[self.names.index(str(parameter))] if self.choices else parameter

    def override(self, parameter: Parameter) -> str:
        """The same as for `--set`, of the scenario in the tuning's folder."""
        if self.choices:
            return self.overrides[self.names.index(str(parameter))]
        return f"{self.path}={toml_value(parameter)}"

    def _number(self, end: float) -> float:
        return int(end) if self.whole else end


def asked_search(text: str) -> Vary:
    """What `--search PATH=…` says; BadInput if it is none of the forms."""
    said = f"--search {text}"
    try:
        vary = replace(vary_of(text), said=said)
    except BadInput as error:
        raise BadInput(said, "", EXPECTED if error.expected == OF_VARY else error.expected) from None
    if isinstance(vary.values, Range) and vary.values.count is not None:
        raise vary.refused(EXPECTED)
    return vary


def search_from(vary: Vary, is_whole: Callable[[str], bool]) -> Search:
    """The search of what was asked; numbers are whole where the scenario's are. BadInput for an empty range."""
    of = vary.values
    if not isinstance(of, Range):
        search = Search(vary.path, choices=of)
        if len(set(search.names)) < len(of):
            raise vary.refused("expected different choices")
        return search
    whole, low, high = is_whole(vary.path), float(of.first), float(of.last)
    if whole:
        low, high = float(floor(low + 0.5)), float(floor(high + 0.5))
    if low >= high:
        raise vary.refused(f"expected LOW below HIGH{', as whole numbers' if whole else ''}")
    if whole and of.log and low < 1:
        raise vary.refused("expected LOW of at least 1 for equal ratios (log)")
    return Search(vary.path, low, high, whole, of.log)
