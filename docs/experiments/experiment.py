"""An experiment, as its file among the figures describes it.

CAMPAIGNS = ("vicsek", "dense")      campaign files, and what their digests are called
COLUMNS = ("order.mean",)            responses that the digests keep
def draw(runs): ...                  from digests by campaign to a matplotlib figure
def told(runs): ...                  to Markdown: tables of the numbers that the page cites
def digested(folder, runs): ...      where a choice of columns is not enough: from a campaign's folder and table
"""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from inspect import getdoc
from pathlib import Path
from typing import Any

import polars as pl

from docs.experiments.places import Places
from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput

NEEDED = ("CAMPAIGNS", "COLUMNS", "draw", "told")


@dataclass(frozen=True)
class Experiment:
    """What is kept of its campaigns, drawn and told."""

    name: str
    about: str  # in one line
    campaigns: tuple[str, ...]
    columns: tuple[str, ...]
    module: Any

    def draw(self, runs: Mapping[str, pl.DataFrame]) -> Any:
        """The matplotlib figure."""
        return self.module.draw(runs)

    def told(self, runs: Mapping[str, pl.DataFrame]) -> str:
        """The numbers, as Markdown."""
        return str(self.module.told(runs)).strip()

    def digested(self, folder: Path, runs: pl.DataFrame) -> pl.DataFrame | None:
        """Its own digest of a campaign; None: it is content with a choice of columns."""
        return self.module.digested(folder, runs) if hasattr(self.module, "digested") else None


def names(places: Places) -> tuple[str, ...]:
    """Of all experiments, in the order of the alphabet."""
    files = places.figures.glob("[a-z]*.py")
    return tuple(sorted(file.stem.replace("_", "-") for file in files))


def find_experiment(name: str, places: Places) -> Experiment:
    """The experiment of this name; BadInput names those that there are, or what its file lacks."""
    known = names(places)
    name = name.replace("_", "-")
    if name not in known:
        raise BadInput("NAME", name, f"unknown experiment; expected {did_you_mean(known, name)}")
    file = places.figures / f"{name.replace('-', '_')}.py"
    module = _module(file)
    for wanted in NEEDED:
        if not hasattr(module, wanted):
            raise BadInput(str(file), wanted, f"is missing: expected {', '.join(NEEDED)}")
    about = (getdoc(module) or "").partition("\n")[0]
    return Experiment(name, about, tuple(module.CAMPAIGNS), tuple(module.COLUMNS), module)


def _module(file: Path) -> Any:
    spec = spec_from_file_location(f"docs.experiments.figures.{file.stem}", file)
    if spec is None or spec.loader is None:
        raise BadInput(str(file), "", "expected a Python file")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
