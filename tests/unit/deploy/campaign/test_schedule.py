"""Executors by name, tasks of a campaign, workers of this machine and of Dask clusters, and workers that die."""

from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import Interrupted
from swarmwire.deploy.campaigns import schedule
from swarmwire.deploy.campaigns.dask import address_of, environment, fault_of
from swarmwire.deploy.campaigns.local import LocalExecutor, Silence, receive, send, usable_cores
from swarmwire.deploy.campaigns.schedule import Finished, default_batch, execute, open_executor, tasks_of
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.campaigns.worker import ALIVE_INTERVAL_S, MAX_SILENCE_S, Alive, Task, TaskResult, run_task
from swarmwire.deploy.runs.controls import Interrupt
from swarmwire.metrics.records.campaign.campaign_json import Campaign
from tests.support.clocks import FakeClock
from tests.support.refusals import refused_input


def opened(name, workers, scenario):
    return name, workers, scenario


def test_executor_of_a_package_is_named_before_its_address(monkeypatch, tmp_path):
    point = EntryPoint("made-up", f"{__name__}:opened", schedule.GROUP)
    monkeypatch.setattr(EntryPoint, "load", lambda _: opened)
    monkeypatch.setattr(schedule, "entry_points_of", lambda group: [point] if group == schedule.GROUP else [])
    assert open_executor("made-up://there:1", 3, tmp_path) == ("made-up://there:1", 3, tmp_path)
    with refused_input("executor", match=r"made-up .did you mean this.*local.*; got 'mad-up://there'"):
        open_executor("mad-up://there", None, tmp_path)


def test_by_default_there_is_a_worker_for_each_core():
    executor = open_executor("local", None, Path())
    assert isinstance(executor, LocalExecutor)
    assert executor.slots == usable_cores() >= 1
    executor.close()
    with refused_input("workers"):
        open_executor("local", 0, Path())


class Made(SimpleNamespace):
    """What tasks_of reads of a campaign."""

    point_of, seed_of, runs = Campaign.point_of, Campaign.seed_of, Campaign.runs


FIXED = {"series": True, "batch": None, "realtime": None, "max_late": 0.01, "vary": {}, "responses": ()}


def made(points, seeds, robots=10, recorded=(), duration_s=60.0):
    overrides = [(f"a={point}",) for point in range(points)]
    fields = {"seeds": tuple(range(1, seeds + 1)), "robots": robots, "record_seeds": recorded, "duration_s": duration_s}
    return Made(points=[{}] * points, point_overrides=overrides, **fields, **FIXED)


def tasks(campaign, done=(), batch=None, workers=2):
    return tasks_of(campaign, CampaignWriter(Path("c"), campaign), done, batch, workers)


@given(st.integers(1, 5), st.integers(1, 130), st.integers(1, 8), st.sets(st.integers(0, 100)))
def test_missing_runs_are_each_in_one_task_of_their_point(points, seeds, workers, done):
    campaign = made(points, seeds, recorded=(1,))
    tasks_left = tasks(campaign, done, workers=workers)
    runs = sorted(run for task in tasks_left for run in task.runs)
    assert runs == [run for run in range(campaign.runs) if run not in done]
    for task in tasks_left:
        assert {campaign.point_of(run) for run in task.runs} == {task.point}
        assert task.overrides == (f"a={task.point}",)
        assert task.seeds == tuple(run % seeds + 1 for run in task.runs)
        assert (task.record_to is not None) == (task.seeds == (1,) or 1 in task.seeds)
        assert len(task.runs) == 1 or task.record_to is None


def test_campaign_in_real_time_goes_seed_by_seed_over_the_points():
    campaign = made(2, 3, recorded=(2,))
    campaign.realtime = 1.0
    order = [(*task.seeds, task.point) for task in tasks(campaign, done={1})]
    assert order == [(1, 0), (1, 1), (2, 1), (3, 0), (3, 1)]


def test_batches_are_large_and_smaller_where_workers_would_be_idle_or_tasks_long():
    assert default_batch(made(9, 200), 2) == 200
    assert default_batch(made(9, 1000), 2) == 250
    assert default_batch(made(9, 300), 2) == 150
    assert default_batch(made(9, 200, duration_s=300.0), 2) == 100
    assert default_batch(made(9, 200, duration_s=36_000.0), 2) == 50
    assert default_batch(made(1, 60), 2) == 15
    assert default_batch(made(1, 3), 8) == 1
    assert default_batch(made(9, 200, robots=1000), 2) == 5
    assert default_batch(made(9, 200, robots=100_000), 2) == 1
    assert {len(task.runs) for task in tasks(made(2, 30), batch=7)} == {6}


class Losing:
    """An executor whose workers die of some runs."""

    slots, records = 2, False

    def __init__(self, *deadly):
        self.deadly, self.tasks, self.tried = set(deadly), [], []

    def submit(self, task):
        assert len(self.tasks) < self.slots
        self.tasks.append(task)
        self.tried.append(task.runs)

    def finished(self, timeout_s):
        task = self.tasks.pop(0)
        if self.deadly & set(task.runs):
            return [Finished(task, None, "gone")]
        return [Finished(task, TaskResult(tuple({"run": run, "ended": "duration"} for run in task.runs)))]

    def close(self):
        pass


def test_lost_task_is_split_until_only_the_deadly_run_fails():
    losing, rows = Losing(2), []
    tasks = [Task("x", (), 0, (0, 1, 2, 3), (1, 2, 3, 4)), Task("x", (), 1, (4,), (1,))]
    assert execute(tasks, losing, lambda _, result: rows.extend(result.rows))
    assert sorted((row["run"], row["ended"]) for row in rows) == [
        (run, "failed" if run == 2 else "duration") for run in range(5)
    ]
    assert losing.tried.count((0, 1, 2, 3)) == losing.tried.count((2, 3)) == losing.tried.count((2,)) == 1
    assert [row["error"] for row in rows if row["run"] == 2] == ["gone"]


def test_stop_leaves_later_tasks_undone():
    losing, rows = Losing(), []
    tasks = [Task("x", (), 0, (run,), (run + 1,)) for run in range(5)]
    assert not execute(tasks, losing, lambda _, result: rows.extend(result.rows), lambda: len(rows) >= 2)
    assert len(rows) == 2


def test_silence_adds_up_except_while_the_campaign_was_frozen():
    clock = FakeClock()
    silence = Silence(clock)
    clock.time_ns += 3600 * NS_PER_S  # Ctrl-Z, and fg
    assert not silence.is_too_long()
    for _ in range(int(MAX_SILENCE_S) - 1):
        clock.time_ns += NS_PER_S
        assert not silence.is_too_long()
    clock.time_ns += NS_PER_S
    assert silence.is_too_long()
    silence.reset()
    assert not silence.is_too_long()


def test_message_arrives_complete_or_not_at_all(tmp_path):
    path = tmp_path / "messages"
    with path.open("wb") as file:
        send(file, {"a": [1, None, "x"], "b": b"\0"})
        send(file, {})
    data = path.read_bytes()
    with path.open("rb") as file:
        assert [receive(file), receive(file), receive(file)] == [{"a": [1, None, "x"], "b": b"\0"}, {}, None]
    for length in range(1, data.index(b"x")):
        path.write_bytes(data[:length])
        with path.open("rb") as file:
            assert receive(file) is None


def test_alive_is_called_once_an_interval_and_not_every_tick():
    clock, calls = FakeClock(), []
    alive = Alive(lambda: calls.append(clock.time_ns) or True, interrupt := Interrupt(), clock)
    for _ in range(20):
        alive.see(None)
        clock.time_ns += NS_PER_S // 10
    assert len(calls) == 2
    assert calls[1] - calls[0] == ALIVE_INTERVAL_S * NS_PER_S
    assert not interrupt.requested


def test_task_that_nobody_waits_for_ends_without_a_row(stumbling):
    with pytest.raises(Interrupted):
        run_task(Task(str(stumbling), ("duration_s=100000",), 0, (0, 1), (1, 2)), alive=lambda: False)


def test_without_the_package_it_is_said_how_to_have_it(monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    with refused_input("executor", match=r"swarmwire\[cluster\]"):
        open_executor("dask://there:8786", None, Path())


@pytest.mark.parametrize(
    ("name", "address"),
    [("dask://there", "there:8786"), ("dask://10.0.0.1:1", "10.0.0.1:1"), ("dask://[::1]:7/", "[::1]:7")],
)
def test_executor_address_without_a_port_gets_the_default(name, address):
    assert address_of(name) == address


@pytest.mark.parametrize(
    "name", ["dask", "dask://", "dask://:8786", "dask://a:b", "dask://a:70000", "dask://tcp://a:1"]
)
def test_executor_address_of_another_form_is_refused(name):
    with refused_input("executor"):
        open_executor(name, None, Path())


def test_workers_fit_with_the_same_versions_and_code_whatever_their_cpu():
    own = environment()
    assert fault_of(own, {**own, "cpu": "other"}) == ""
    assert fault_of(own, {**own, "versions": {**own["versions"], "python": "3.9.0"}}).startswith("python is 3.9.0")
    assert fault_of(own, {**own, "versions": {}}).startswith("python is not there")
    assert "swarmwire.comms" in fault_of(own, {**own, "modules": {}})
