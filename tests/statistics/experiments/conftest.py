from pathlib import Path

import pytest

from docs.experiments.experiment import Layout
from tests.support.deploy.campaign import scenario_in

CAMPAIGN = """
format = 1
name = "two robots and losses"
scenario = "two.toml"
seeds = 3
series = false

[vary]
"radio.loss" = [0.0, 0.9]
"""
FIGURE = '''"""How many packets of two robots are received.

More of it.
"""

import polars as pl

CAMPAIGNS = ("two-losses",)
COLUMNS = ("radio.link_pdr",)


def draw(runs):
    from swarmwire.metrics.pictures.report.axes import column_axes

    figure, axes = column_axes("received", "loss")
    axes.plot(runs["two-losses"]["radio.loss"], runs["two-losses"]["radio.link_pdr"], ".")
    return figure


def numbers(runs):
    received = runs["two-losses"].group_by("radio.loss", maintain_order=True).agg(pl.col("radio.link_pdr").mean())
    table = received.select("radio.loss", "radio.link_pdr")
    rows = "".join(f"| {loss:g} | {pdr:.2f} |\\n" for loss, pdr in table.iter_rows())
    return f"| loss | received |\\n| --- | --- |\\n{rows}"
'''


@pytest.fixture
def folders(tmp_path: Path) -> Layout:
    """Those of one experiment, `two-received`, with a page."""
    created = Layout(*(tmp_path / name for name in ("figures", "campaigns", "swept", "data", "pages")))
    for folder in (created.figures, created.campaigns, created.pages):
        folder.mkdir()
    (created.figures / "__init__.py").write_text("")
    (created.figures / "two_received.py").write_text(FIGURE)
    scenario_in(created.campaigns)
    (created.campaigns / "two-losses.toml").write_text(CAMPAIGN)
    (created.pages / "two-received.md").write_text("# Two\n\n<!-- numbers -->\nold\n<!-- /numbers -->\n\nThe end.\n")
    return created
