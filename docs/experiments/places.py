"""Where what belongs to an experiment lies."""

from dataclasses import dataclass, replace
from pathlib import Path

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Places:
    """Folders of experiments: what is written by hand, and what their commands make."""

    figures: Path  # NAME.py: what is kept, drawn and told
    campaigns: Path  # CAMPAIGN.toml, as `swarmwire sweep` takes them
    swept: Path  # CAMPAIGN/: folders of campaigns
    data: Path  # CAMPAIGN.parquet: digests of them
    pages: Path  # figures, and NAME.md if there is a page
    figure_ending: str = ".svg"  # of a figure's name, after the experiment's

    def figure_of(self, name: str) -> Path:
        """Where the figure of an experiment lies."""
        return self.pages / f"{name}{self.figure_ending}"

    def trial(self, seeds: str) -> "Places":
        """The same with all that is made put aside: a trial with a few seeds must not replace what is published."""
        aside = self.swept / f"seeds-{seeds.replace(':', '-').replace(',', '-')}"
        return replace(self, swept=aside, data=aside / "data", pages=aside)


HERE = Places(
    figures=ROOT / "docs" / "experiments" / "figures",
    campaigns=ROOT / "scenarios" / "papers",
    swept=ROOT / "campaigns" / "papers",
    data=ROOT / "docs" / "experiments" / "data",
    pages=ROOT / "docs" / "experiments",
)
