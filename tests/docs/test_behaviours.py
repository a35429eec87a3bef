"""The scenario that a behaviour's page names runs, and the figure of a campaign is drawn from its sweep."""

import re
import tomllib
from dataclasses import replace
from typing import Any

import pytest
from rich.console import Console

from docs.behaviours.degradation import degradation_of
from docs.behaviours.shown import LAYOUT, SCENARIOS, find_shown
from docs.experiments.making import run as run_experiment
from swarmwire.agent import behaviours
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy import run
from swarmwire.deploy.campaigns.sweep import ExecutionOptions

CLASSES: dict[str, Any] = {
    re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower(): getattr(behaviours, name) for name in behaviours.__all__
}
OF_EACH = pytest.mark.parametrize("name", CLASSES)


@OF_EACH
def test_scenario_of_a_behaviour_page_runs_that_behaviour(name):
    file = SCENARIOS / f"{name}.toml"
    groups = tomllib.loads(file.read_text(encoding="utf-8"))["robots"].values()
    assert {group["agent"] for group in groups} == {f"swarmwire.agent.behaviours:{CLASSES[name].__name__}"}
    result = run(file, overrides=["duration_s=1.0"])
    assert result.summary()["ticks"] > 0


def test_degradation_table_and_figure_come_from_a_sweep(tmp_path):
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
    own = replace(LAYOUT, campaigns=tmp_path, swept=tmp_path / "swept", data=tmp_path / "data", pages=tmp_path)
    options = ExecutionOptions(workers=1), Console(quiet=True)
    output = run_experiment(degradation_of("consensus", own), own, None, *options)
    rows = [line.split("|")[1:-1] for line in output.splitlines() if "%" in line and "|" in line]
    assert [row[0].strip() for row in rows] == ["0 %", "100 %"]
    soon, late = (float(cell.split()[0]) for cell in rows[0][1:])
    assert 0.0 < soon < late < 20.0
    assert [cell.strip() for cell in rows[1][1:]] == ["beyond 20", "beyond 20"], "who hears nobody agrees with nobody"
    assert b"<svg" in own.figure_of("consensus").read_bytes()[:1000]


def test_unknown_behaviour_or_campaign_is_refused_with_its_kind(tmp_path):
    with pytest.raises(BadInput, match="unknown behaviour"):
        find_shown("flying", LAYOUT)
    with pytest.raises(BadInput, match="expected the campaign of a behaviour"):
        find_shown("flocking", replace(LAYOUT, campaigns=tmp_path))
