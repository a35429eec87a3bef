"""Every behaviour has a page, a picture of a scenario that runs, and a figure that is the one its digest gives."""

import re
import tomllib
from dataclasses import replace
from typing import Any

import polars as pl
import pytest
from rich.console import Console

from docs.behaviours.degradation import LATENCY, LOSS, degradation_of
from docs.behaviours.places import HERE, SCENARIOS, names
from docs.behaviours.shown import SHOWN, find_shown
from docs.experiments.drawing import draw
from docs.experiments.running import run as run_experiment
from swarmwire.agent import behaviours
from swarmwire.comms.errors import BadInput
from swarmwire.deploy import run
from swarmwire.deploy.campaign.campaign_file import asked_in, campaign_table
from swarmwire.deploy.campaign.plan import planned
from swarmwire.deploy.campaign.sweeping import Means
from swarmwire.metrics.whole_file import write_whole

MOST_BYTES = 150_000
PICTURES = ".png", "-degradation.svg"
CLASSES: dict[str, Any] = {
    getattr(behaviours, name).__module__.rpartition(".")[2]: getattr(behaviours, name) for name in behaviours.__all__
}
OF_EACH = pytest.mark.parametrize("name", CLASSES)


def page(name: str) -> str:
    return (HERE.pages / f"{name}.md").read_text(encoding="utf-8")


def test_there_is_a_page_for_each_behaviour_and_nothing_else():
    assert len(CLASSES) == len(behaviours.__all__), "two behaviours in one file"
    for found in (names(HERE), SHOWN, [file.stem for file in HERE.pages.glob("*.md")]):
        assert sorted(found) == sorted(CLASSES)
    assert sorted(file.stem for file in HERE.data.iterdir()) == sorted(CLASSES)


@OF_EACH
def test_a_page_shows_its_pictures_and_the_reference_and_names_the_scenario(name):
    text = page(name)
    assert f"```{{reference}} behaviour {CLASSES[name].__name__}\n" in text
    assert f"uv run swarmwire run scenarios/behaviours/{name}.toml\n" in text
    assert re.findall(r"^!\[.+\]\((.+)\)$", text, re.MULTILINE) == [f"{name}{ending}" for ending in PICTURES]
    for ending in PICTURES:
        assert (HERE.pages / f"{name}{ending}").stat().st_size < MOST_BYTES


@OF_EACH
def test_the_scenario_of_a_page_runs_the_behaviour(name):
    file = SCENARIOS / f"{name}.toml"
    groups = tomllib.loads(file.read_text(encoding="utf-8"))["robots"].values()
    assert {group["agent"] for group in groups} == {f"swarmwire.agent.behaviours:{CLASSES[name].__name__}"}
    result = run(file, overrides=["duration_s=1.0"])
    assert result.summary()["ticks"] > 0


@OF_EACH
def test_the_digest_is_of_the_whole_campaign(name):
    file = HERE.campaigns / f"{name}.toml"
    table = campaign_table(file)
    assert table is not None
    assert table["scenario"] == f"../{name}.toml"
    plan = planned(asked_in(file, table))
    loss, latency = plan.vary()
    found = pl.read_parquet(HERE.data / f"{name}.parquet")
    for path, column in ((loss, LOSS), (latency, LATENCY)):
        assert sorted(found[column].unique()) == plan.vary()[path]
    assert set(found["seed"]) == set(plan.asked.seeds)
    assert len(found) == len(plan.points) * len(plan.asked.seeds)


@OF_EACH
def test_the_figure_and_the_numbers_of_a_page_are_those_of_its_digest(name, tmp_path):
    write_whole(tmp_path / f"{name}.md", page(name))
    draw(degradation_of(name, HERE), replace(HERE, pages=tmp_path))
    hint = f"python -m docs.behaviours draw {name}"
    assert (tmp_path / f"{name}.md").read_text(encoding="utf-8") == page(name), hint
    assert (tmp_path / f"{name}-degradation.svg").read_bytes() == HERE.figure_of(name).read_bytes(), hint


def test_what_is_drawn_comes_of_a_sweep(tmp_path):
    (tmp_path / "consensus.toml").write_text(f"""
format = 1
scenario = '{SCENARIOS / "consensus.toml"}'
seeds = 2
overrides = ['duration_s = 20', 'robots.nodes.count = 4', 'arena.size_m = [1.0, 1.0]',
             'stop = {{ metric = "consensus_error", at_most = 0.1 }}']
[vary]
"radio.loss" = [0.0, 1.0]
"radio.latency_s" = [0.0, 0.5]
""")
    own = replace(HERE, campaigns=tmp_path, swept=tmp_path / "swept", data=tmp_path / "data", pages=tmp_path)
    told = run_experiment(degradation_of("consensus", own), own, None, Means(workers=1), Console(quiet=True))
    rows = [line.split("|")[1:-1] for line in told.splitlines() if "%" in line and "|" in line]
    assert [row[0].strip() for row in rows] == ["0 %", "100 %"]
    soon, late = (float(cell.split()[0]) for cell in rows[0][1:])
    assert 0.0 < soon < late < 20.0
    assert [cell.strip() for cell in rows[1][1:]] == ["beyond 20", "beyond 20"], "who hears nobody agrees with nobody"
    assert b"<svg" in own.figure_of("consensus").read_bytes()[:1000]


def test_what_is_not_there_is_named(tmp_path):
    with pytest.raises(BadInput, match="unknown behaviour"):
        find_shown("flying", HERE)
    with pytest.raises(BadInput, match="expected the campaign of a behaviour"):
        find_shown("flocking", replace(HERE, campaigns=tmp_path))
