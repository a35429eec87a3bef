"""A scenario's [stop] ends each arena once a metric has compared as asked with a number for long enough."""

import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import RunFolder, Simulation, repeat, run
from swarmwire.deploy.campaign.columns import responses_of, row_of
from swarmwire.metrics.run_folder.table import State
from swarmwire.metrics.run_folder.verify import verify
from swarmwire.world.scenario_file import load_scenario
from tests.support.metrics.packages import CODE

SCENARIO = """
format = 1
name = "flock"
duration_s = 4.0
[arena]
size_m = [4.0, 4.0]
[robots.flock]
body = "epuck"
count = 6
agent = "swarmwire.agent.behaviours:Flocking"
[radio]
range_m = 2.0
loss = 0.1
measures = { range = {}, bearing = {} }
[stop]
metric = "order"
at_least = 0.85
hold_s = 0.5
"""
SEEDS = [1, 2, 3, 4, 5]


@pytest.fixture
def scenario(tmp_path):
    (tmp_path / "own.py").write_text(CODE)
    (tmp_path / "s.toml").write_text(SCENARIO)
    return tmp_path / "s.toml"


def first_held(order, ticks):
    """The first tick of the first `ticks` in a row with an order of at least 0.85, None without such."""
    for start in range(len(order) - ticks + 1):
        if np.all(order[start : start + ticks] >= 0.85):
            return start
    return None


def test_each_arena_ends_when_its_own_metric_has_held_and_others_go_on(tmp_path, scenario):
    result = run(scenario, seeds=SEEDS, out=tmp_path / "run")
    whole = run(scenario, seeds=SEEDS, overrides=["stop=[]"], out=tmp_path / "whole")
    assert {arena.ended for arena in whole.arenas} == {"duration"}
    assert [arena.stop_time_s for arena in whole.arenas] == [None] * len(SEEDS)
    assert {arena.ended for arena in result.arenas} == {"stopped", "duration"}
    for number, arena in enumerate(result.arenas):
        order = RunFolder(tmp_path / "whole").metrics(number)["order"].to_numpy()
        start = first_held(order, 6)
        if start is None:
            assert (arena.ended, arena.stop_time_s, arena.stopped_by, arena.ticks) == ("duration", None, None, 40)
            assert arena == whole.arenas[number]
        else:
            assert arena.ended == "stopped"
            assert arena.stop_time_s == pytest.approx(start / 10)
            assert arena.stopped_by == "order at least 0.85 for 0.5 s"
            assert (arena.ticks, arena.sim_time_s) == (start + 6, pytest.approx((start + 6) / 10))
            assert (
                RunFolder(tmp_path / "run").metrics(number)["order"].to_numpy().tolist() == order[: start + 6].tolist()
            )
    summary = result.summary()
    assert summary["stop"] == ["order at least 0.85 for 0.5 s"]
    assert [end["stop_time_s"] for end in summary["by_arena"]] == [arena.stop_time_s for arena in result.arenas]
    assert RunFolder(tmp_path / "run").summary == summary
    assert {finding.state for finding in verify(tmp_path / "run")} <= {State.INTACT, State.NOT_RECORDED}


def test_an_arena_comes_to_the_same_alone_as_beside_others(scenario):
    together = run(scenario, seeds=SEEDS)
    for seed, arena in zip(SEEDS, together.arenas, strict=True):
        assert run(scenario, seed=seed).arenas == (arena,)


def test_rows_of_a_campaign_say_when_and_by_what_each_run_stopped(scenario):
    listed = 'metrics=["aggregation_time_s"]'
    for arena in run(scenario, seeds=SEEDS, overrides=[listed, "robots.flock.count=3"]).arenas:
        row = row_of(arena, {"aggregation_time_s"})
        expected = (arena.ended, arena.ticks, arena.sim_time_s, arena.stop_time_s, arena.stopped_by)
        assert tuple(row[name] for name in ("ended", "ticks", "sim_time_s", "stop_time_s", "stopped_by")) == expected
        assert row["aggregation_time_s"] == arena.metrics["aggregation_time_s"].final
    by_column = {response.column: response.kind for response in responses_of([load_scenario(scenario, [listed])])}
    assert by_column["stop_time_s"] == by_column["aggregation_time_s"] == "time"
    assert "stop_time_s" not in {of.column for of in responses_of([load_scenario(scenario, ["stop=[]"])])}


def test_a_run_whose_arenas_have_all_stopped_is_over_and_is_repeated_from_its_folder(tmp_path, scenario):
    result = run(scenario, overrides=["stop.at_least=0.1", "stop.hold_s=0"], out=tmp_path / "run")
    assert (result.ended, result.arenas[0].ended) == ("stopped", "stopped")
    assert result.ticks == result.arenas[0].ticks < 40
    again = repeat(tmp_path / "run")
    assert again.same
    assert again.result.arenas == result.arenas


def test_a_metric_that_nothing_lists_is_measured_if_it_ends_arenas(scenario):
    only = ["standard_metrics=false", "stop.metric=rotation", "stop.at_least=0.0"]
    result = run(scenario, overrides=only)
    assert list(result.metrics) == ["rotation"]
    assert result.arenas[0].stop_time_s == 0.0


def test_a_metric_of_ones_own_ends_arenas_by_its_name_with_its_parameters(scenario):
    listed = 'metrics=[{ metric = "own.py:East", from_m = 9.0 }]'
    result = run(scenario, overrides=[listed, "stop.metric=east", "stop.at_least=-100.0", "stop.hold_s=0.3"])
    assert result.arenas[0].stopped_by == "east at least -100 for 0.3 s"
    assert (result.arenas[0].ticks, result.arenas[0].stop_time_s) == (4, 0.0)
    never = run(scenario, overrides=[listed, "stop.metric=east", "stop.at_least=0.0", "duration_s=0.5"])
    assert (never.ended, never.arenas[0].stopped_by) == ("duration", None)


def test_a_time_ends_an_arena_as_soon_as_it_has_happened(scenario):
    gathered = 'metrics=[{ metric = "aggregation_time_s", share = 0.1, hold_s = 0.2 }]'
    result = run(
        scenario, overrides=[gathered, "stop.metric=aggregation_time_s", "stop.at_least=0.0", "stop.hold_s=0.0"]
    )
    assert result.ended == "stopped"
    assert result.metrics["aggregation_time_s"].final is not None


def test_a_metric_that_there_is_not_is_refused_before_the_run(scenario):
    with pytest.raises(BadInput, match=r"s\.toml: stop\.metric: .*rotation\?"):
        Simulation(scenario, overrides=["stop.metric=rotaton"])
    with pytest.raises(BadInput, match=r"stop\.1\.metric: "):
        Simulation(scenario, overrides=['stop=[{metric="order", above=1}, {metric="x", above=1}]'])
