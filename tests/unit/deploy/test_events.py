"""Events in a whole run, and conditions that end its arenas: the same in every layout, told in the summary."""

import json

import numpy as np
import pytest

from swarmwire.deploy import Result, RunFolder, Simulation, repeat, run
from swarmwire.deploy.campaigns.columns import responses_of, row_of
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.scenario_file import load_scenario
from tests.support.custom_code import CODE
from tests.support.deploy.joiners import Watcher
from tests.support.deploy.runs import DISRUPTED, DISRUPTED_SHORT, PER_ROBOT, run_spread
from tests.support.refusals import refused_input


@pytest.fixture(scope="module")
def local() -> Result:
    return run(DISRUPTED, overrides=DISRUPTED_SHORT)


def test_summary_lists_events_with_tick_and_robots(local, tmp_path):
    begun = {3: "blackout", 6: "kill", 11: "kill", 13: "partition", 27: "revive"}
    ended = {15: "kill", 18: "blackout", 25: "partition"}
    assert {event.tick: event.do for event in local.events if not event.ended} == begun
    assert {event.tick: event.do for event in local.events if event.ended} == ended
    run(DISRUPTED, overrides=DISRUPTED_SHORT, out=tmp_path / "run")
    events = json.loads((tmp_path / "run" / "summary.json").read_text())["events"]
    killed = local.events[1].robots[0]
    expected = {"at_s": 0.6, "tick": 6, "do": "kill", "part": "", "ended": False, "singly": False, "robots": killed}
    assert events[1] == expected
    assert len(killed) == 4
    assert [len(event["robots"]) for event in events if event["do"] == "partition"] == [20, 20]


def test_fates_add_up_and_each_disruption_has_its_own(local):
    fates = local.radio.fates
    assert sum(fates.values()) == local.radio.intended
    assert all(fates[name] > 0 for name in ("received", "receiver_dead", "blackout", "partitioned"))


def test_event_after_the_end_changes_nothing():
    late = [f"events.{i}.at_s=1000" for i in range(5)]
    result = run(DISRUPTED, overrides=["duration_s=2", *late])
    assert result.events == ()
    assert result.trajectory_sha256 == run(DISRUPTED, overrides=["duration_s=2", "events=[]"]).trajectory_sha256


REMEMBERS = """
from swarmwire.agent import Agent, Robot

class Remembers(Agent):
    def __init__(self):
        self.steps = 0

    def step(self, robot: Robot) -> None:
        self.steps += 1
        robot.drive(0.001 * self.steps, 0.0)
"""
AFRESH = """format = 1
name = "afresh"
duration_s = 1.0
arena = { size_m = [4.0, 4.0] }
robots.a = { body = "epuck", count = 2, agent = "mine.py:Remembers", place = { how = "grid", spacing_m = 1.0 } }
events = [{ at_s = 0.5, do = "kill", robots = { names = ["a-0"] }, for_s = 0.3 }]
"""


@pytest.mark.parametrize("runners", [None, PER_ROBOT])
def test_revived_robot_starts_without_memory(tmp_path, runners):
    """Its speed tells how many steps it remembers; it is dead in ticks 5 to 7."""
    (tmp_path / "mine.py").write_text(REMEMBERS)
    scenario = tmp_path / "s.toml"
    scenario.write_text(AFRESH)
    watcher = Watcher()
    run_spread(scenario, runners, observers=[watcher])
    speeds_mmps = np.array([truth.command[:, 0] for truth in watcher.truths]) * 1000
    assert speeds_mmps[:, 0].round().tolist() == [1, 2, 3, 4, 5, 0, 0, 0, 1, 2]
    assert speeds_mmps[:, 1].round().tolist() == list(range(1, 11))


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
def stopping(tmp_path):
    (tmp_path / "own.py").write_text(CODE)
    (tmp_path / "s.toml").write_text(SCENARIO)
    return tmp_path / "s.toml"


def first_held(order, ticks):
    """The first tick of the first `ticks` in a row with an order of at least 0.85, None without such."""
    for start in range(len(order) - ticks + 1):
        if np.all(order[start : start + ticks] >= 0.85):
            return start
    return None


def test_arena_ends_when_its_metric_has_held_and_others_go_on(tmp_path, stopping):
    result = run(stopping, seeds=SEEDS, out=tmp_path / "run")
    complete = run(stopping, seeds=SEEDS, overrides=["stop=[]"], out=tmp_path / "whole")
    assert {arena.ended for arena in complete.arenas} == {"duration"}
    assert [arena.stop_time_s for arena in complete.arenas] == [None] * len(SEEDS)
    assert {arena.ended for arena in result.arenas} == {"stopped", "duration"}
    for number, arena in enumerate(result.arenas):
        order = RunFolder(tmp_path / "whole").metrics(number)["order"].to_numpy()
        start = first_held(order, 6)
        if start is None:
            assert (arena.ended, arena.stop_time_s, arena.stopped_by, arena.ticks) == ("duration", None, None, 40)
            assert arena == complete.arenas[number]
        else:
            assert arena.ended == "stopped"
            assert arena.stop_time_s == pytest.approx(start / 10)
            assert arena.stopped_by == "order at least 0.85 for 0.5 s"
            assert (arena.ticks, arena.sim_time_s) == (start + 6, pytest.approx((start + 6) / 10))
            recorded = RunFolder(tmp_path / "run").metrics(number)["order"].to_list()
            assert recorded == order[: start + 6].tolist()
    summary = result.summary()
    assert summary["stop"] == ["order at least 0.85 for 0.5 s"]
    assert [end["stop_time_s"] for end in summary["by_arena"]] == [arena.stop_time_s for arena in result.arenas]
    assert RunFolder(tmp_path / "run").summary == summary
    assert {finding.state for finding in verify(tmp_path / "run")} <= {TableState.INTACT, TableState.NOT_RECORDED}


def test_arena_that_stops_has_the_same_result_alone_and_among_others(stopping):
    together = run(stopping, seeds=SEEDS)
    for seed, arena in zip(SEEDS, together.arenas, strict=True):
        assert run(stopping, seed=seed).arenas == (arena,)


def test_rows_of_a_campaign_say_when_and_by_what_each_run_stopped(stopping):
    listed = 'metrics=["aggregation_time_s"]'
    for arena in run(stopping, seeds=SEEDS, overrides=[listed, "robots.flock.count=3"]).arenas:
        row = row_of(arena, {"aggregation_time_s"})
        expected = (arena.ended, arena.ticks, arena.sim_time_s, arena.stop_time_s, arena.stopped_by)
        assert tuple(row[name] for name in ("ended", "ticks", "sim_time_s", "stop_time_s", "stopped_by")) == expected
        assert row["aggregation_time_s"] == arena.metrics["aggregation_time_s"].final
    by_column = {response.column: response.kind for response in responses_of([load_scenario(stopping, [listed])])}
    assert by_column["stop_time_s"] == by_column["aggregation_time_s"] == "time"
    assert "stop_time_s" not in {response.column for response in responses_of([load_scenario(stopping, ["stop=[]"])])}


def test_run_ends_when_all_arenas_have_stopped_and_is_repeatable(tmp_path, stopping):
    result = run(stopping, overrides=["stop.at_least=0.1", "stop.hold_s=0"], out=tmp_path / "run")
    assert (result.ended, result.arenas[0].ended) == ("stopped", "stopped")
    assert result.ticks == result.arenas[0].ticks < 40
    again = repeat(tmp_path / "run")
    assert again.same
    assert again.result.arenas == result.arenas


def test_stop_metric_that_is_not_listed_is_measured(stopping):
    only = ["standard_metrics=false", "stop.metric=rotation", "stop.at_least=0.0"]
    result = run(stopping, overrides=only)
    assert list(result.metrics) == ["rotation"]
    assert result.arenas[0].stop_time_s == 0.0


def test_stop_metric_of_a_user_ends_arenas_with_its_parameters(stopping):
    listed = 'metrics=[{ metric = "own.py:East", from_m = 9.0 }]'
    result = run(stopping, overrides=[listed, "stop.metric=east", "stop.at_least=-100.0", "stop.hold_s=0.3"])
    assert result.arenas[0].stopped_by == "east at least -100 for 0.3 s"
    assert (result.arenas[0].ticks, result.arenas[0].stop_time_s) == (4, 0.0)
    never = run(stopping, overrides=[listed, "stop.metric=east", "stop.at_least=0.0", "duration_s=0.5"])
    assert (never.ended, never.arenas[0].stopped_by) == ("duration", None)


def test_stop_metric_that_is_a_time_ends_an_arena_once_reached(stopping):
    gathered = 'metrics=[{ metric = "aggregation_time_s", share = 0.1, hold_s = 0.2 }]'
    stop = ["stop.metric=aggregation_time_s", "stop.at_least=0.0", "stop.hold_s=0.0"]
    result = run(stopping, overrides=[gathered, *stop])
    assert result.ended == "stopped"
    assert result.metrics["aggregation_time_s"].final is not None


def test_stop_metric_that_is_unknown_is_refused_before_the_run(stopping):
    with refused_input(stopping, "stop.metric", "rotation"):
        Simulation(stopping, overrides=["stop.metric=rotaton"])
    with refused_input(key="stop.1.metric"):
        Simulation(stopping, overrides=['stop=[{metric="order", above=1}, {metric="x", above=1}]'])
