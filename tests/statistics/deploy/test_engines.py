"""The shipped scenarios come to the same on average with either floor engine; the summary says which it was."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from swarmwire.deploy import Result, run
from tests.support.deploy.commands import ROOT
from tests.support.world.pairs import assert_same_on_average

SHIPPED = {
    "avoidance": (["duration_s=60"], ("order_velocity", "min_gap")),
    "flocking": (["duration_s=60"], ("order", "min_gap")),
    "five-percent": (["duration_s=60"], ("order", "largest_component")),
    "infrared": ([], ("order", "throughput")),
    "pso": (["duration_s=120"], ("target_mean", "target_best", "age_of_information")),
    "warehouse-wifi": (["duration_s=30"], ("order_velocity", "min_gap", "throughput")),
}


def means(name: str, engine: str, seeds: int, overrides: list[str]) -> Result:
    path = ROOT / "scenarios" / f"{name}.toml"
    return run(path, seeds=range(1, seeds + 1), overrides=[*overrides, f"physics.engine={engine}"])


def compare(name: str, seeds: int) -> None:
    """The means of these metrics over a run."""
    overrides, metrics = SHIPPED[name]
    discs, pymunk = (means(name, engine, seeds, overrides) for engine in ("discs", "pymunk"))
    assert (discs.engine, pymunk.engine) == ("discs", "pymunk")
    for metric in metrics:
        ours, theirs = (np.array([arena.metrics[metric].mean for arena in of.arenas]) for of in (discs, pymunk))
        assert_same_on_average(f"{name}, {metric}", ours, theirs)


def test_a_few_seeds_of_a_shipped_scenario_agree() -> None:
    compare("avoidance", 12)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", list(SHIPPED))
def test_shipped_scenarios_agree(name: str) -> None:
    compare(name, 30)


@pytest.mark.parametrize(("physics", "engine"), [([], "discs"), (["physics.engine=kinematic"], "kinematic")])
def test_the_summary_names_the_engine(physics: list[str], engine: str, tmp_path: Path) -> None:
    out = tmp_path / "run"
    result = run(ROOT / "scenarios" / "avoidance.toml", overrides=["duration_s=1", *physics], out=out)
    summary: dict[str, Any] = json.loads((out / "summary.json").read_text())
    assert result.engine == summary["engine"] == engine
