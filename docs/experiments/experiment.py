"""An experiment, as its file among the figures describes it, and where what belongs to it lies.

CAMPAIGNS = ("vicsek", "dense")      campaign files, and what their digests are called
COLUMNS = ("order.mean",)            responses that the digests keep
def draw(runs): ...                  from digests by campaign to a matplotlib figure
def numbers(runs): ...               to Markdown: tables of the numbers that the page cites
def digested(folder, runs): ...      where a choice of columns is not enough: from a campaign's folder and table
PAGE = "pso"                         where another experiment's page shows this one, too
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.util import module_from_spec, spec_from_file_location
from inspect import getdoc
from pathlib import Path
from typing import Any

import polars as pl

from swarmwire.comms.base.config import did_you_mean
from swarmwire.comms.base.errors import BadInput

ROOT = Path(__file__).parents[2]
NEEDED = ("CAMPAIGNS", "COLUMNS", "draw", "numbers")


@dataclass(frozen=True)
class Layout:
    """Folders of experiments: what is written by hand, and what their commands make."""

    figures: Path  # NAME.py: what is kept, drawn and told
    campaigns: Path  # CAMPAIGN.toml, as `swarmwire sweep` takes them
    swept: Path  # CAMPAIGN/: folders of campaigns
    data: Path  # CAMPAIGN.parquet: digests of them
    pages: Path  # figures, and PAGE.md if there is a page
    figure_ending: str = ".svg"  # of a figure's name, after the experiment's

    def figure_of(self, name: str) -> Path:
        """Where the figure of an experiment lies."""
        return self.pages / f"{name}{self.figure_ending}"

    def trial(self, seeds: str) -> "Layout":
        """The same with all that is made put aside: a trial with a few seeds must not replace what is published."""
        aside = self.swept / f"seeds-{seeds.replace(':', '-').replace(',', '-')}"
        return replace(self, swept=aside, data=aside / "data", pages=aside)


LAYOUT = Layout(
    figures=ROOT / "docs" / "experiments" / "figures",
    campaigns=ROOT / "scenarios" / "papers",
    swept=ROOT / "campaigns" / "papers",
    data=ROOT / "docs" / "experiments" / "data",
    pages=ROOT / "docs" / "experiments",
)


@dataclass(frozen=True)
class Experiment:
    """What is kept of its campaigns, drawn and told."""

    name: str
    about: str  # in one line
    campaigns: tuple[str, ...]
    columns: tuple[str, ...]
    module: Any
    page: str  # its name, or that of the experiment whose page shows this one

    def draw(self, runs: Mapping[str, pl.DataFrame]) -> Any:
        """The matplotlib figure."""
        return self.module.draw(runs)

    def numbers(self, runs: Mapping[str, pl.DataFrame]) -> str:
        """The numbers, as Markdown."""
        return str(self.module.numbers(runs)).strip()

    def digested(self, folder: Path, runs: pl.DataFrame) -> pl.DataFrame | None:
        """Its own digest of a campaign; None: it is content with a choice of columns."""
        return self.module.digested(folder, runs) if hasattr(self.module, "digested") else None


def names(layout: Layout) -> tuple[str, ...]:
    """Of all experiments, in the order of the alphabet."""
    files = layout.figures.glob("[a-z]*.py")
    return tuple(sorted(file.stem.replace("_", "-") for file in files))


def find_experiment(name: str, layout: Layout) -> Experiment:
    """The experiment of this name; BadInput names those that there are, or what its file lacks."""
    known_names = names(layout)
    name = name.replace("_", "-")
    if name not in known_names:
        raise BadInput("NAME", name, f"unknown experiment; expected {did_you_mean(known_names, name)}")
    file = layout.figures / f"{name.replace('-', '_')}.py"
    module = _module(file)
    for required in NEEDED:
        if not hasattr(module, required):
            raise BadInput(str(file), required, f"is missing: expected {', '.join(NEEDED)}")
    about = (getdoc(module) or "").partition("\n")[0]
    return Experiment(
        name, about, tuple(module.CAMPAIGNS), tuple(module.COLUMNS), module, getattr(module, "PAGE", name)
    )


def _module(file: Path) -> Any:
    spec = spec_from_file_location(f"docs.experiments.figures.{file.stem}", file)
    if spec is None or spec.loader is None:
        raise BadInput(str(file), "", "expected a Python file")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module
