"""Where what belongs to the pages of behaviours lies."""

from docs.experiments.places import ROOT, Places

SCENARIOS = ROOT / "scenarios" / "behaviours"
HERE = Places(
    figures=ROOT / "docs" / "behaviours",
    campaigns=SCENARIOS / "campaigns",
    swept=ROOT / "campaigns" / "behaviours",
    data=ROOT / "docs" / "behaviours" / "data",
    pages=ROOT / "docs" / "behaviours",
    figure_ending="-degradation.svg",
)


def names(places: Places) -> tuple[str, ...]:
    """Of all behaviours that have a campaign, in the order of the alphabet."""
    return tuple(sorted(file.stem for file in places.campaigns.glob("*.toml")))
