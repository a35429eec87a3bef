"""What fails is a row that says why, and stops nothing else."""

from swarmwire.deploy import sweep
from swarmwire.deploy.campaign.execution import execute
from swarmwire.deploy.campaign.executor import Finished
from swarmwire.deploy.campaign.task import Task, TaskResult
from tests.support.deploy.campaign.small import rows_in, series_in


def test_an_agent_that_fails_for_some_seeds_costs_no_others(tmp_path, stumbling, here):
    done = sweep(stumbling, seeds=4, out=tmp_path / "c", batch=4)
    rows = rows_in(tmp_path / "c")
    failed = [row["seed"] for row in rows if row["ended"] == "failed"]
    assert done.is_over
    assert done.failed == len(failed)
    assert 0 < len(failed) < 4
    for row in rows:
        assert (row["error"] is None) == (row["seed"] not in failed) == (row["order.final"] is not None)
        if row["error"]:
            assert "ValueError: stumbled" in row["error"]
            assert 'File "scenario/files/stumbling.py", line' in row["error"]
    assert set(series_in(tmp_path / "c")["run"]) == {seed - 1 for seed in range(1, 5) if seed not in failed}
    sweep(stumbling, seeds=4, out=tmp_path / "unpacked", batch=1)
    assert rows_in(tmp_path / "unpacked") == rows


def test_a_seed_without_room_is_a_failed_row(tmp_path, scenario, here):
    crowd = ["robots.pair.count=20", 'robots.pair.place={how="disc", radius_m=0.05}']
    done = sweep(scenario, seeds=2, out=tmp_path / "c", overrides=crowd)
    assert done.failed == 2
    assert "room" in rows_in(tmp_path / "c")[0]["error"]


def test_a_metric_of_ones_own_that_raises_is_a_failed_row(tmp_path, scenario, here):
    (tmp_path / "bad.py").write_text(
        "from dataclasses import dataclass\nfrom swarmwire.metrics.metric import Metric\n"
        "@dataclass(frozen=True)\nclass Bad(Metric):\n    name = 'bad'; help = ''; bounds = (0.0, None)\n"
        "    def begin(self, static): return self\n    def __call__(self, moment): raise RuntimeError('no number')\n"
    )
    assert sweep(scenario, seeds=2, out=tmp_path / "c", overrides=['metrics=["bad.py:Bad"]']).failed == 2
    assert "no number" in rows_in(tmp_path / "c")[1]["error"]


def test_an_error_that_no_file_can_hold_is_told_as_far_as_it_can(tmp_path, scenario, here):
    agent = (
        "from swarmwire.agent import Agent\nclass Odd(Agent):\n    def step(self, robot): raise OSError('a\\udc80b')\n"
    )
    (tmp_path / "odd.py").write_text(agent)
    sweep(scenario, seeds=1, out=tmp_path / "c", overrides=['robots.pair.agent="odd.py:Odd"'])
    assert "OSError: a?b" in rows_in(tmp_path / "c")[0]["error"]


def test_an_agent_that_calls_itself_for_ever_fails_alike_in_any_pack(tmp_path, scenario, here):
    agent = "from swarmwire.agent import Agent\nclass Deep(Agent):\n    def step(self, robot): self.step(robot)\n"
    (tmp_path / "deep.py").write_text(agent)
    for batch in (1, 2):
        overrides = ['robots.pair.agent="deep.py:Deep"']
        sweep(scenario, seeds=2, out=tmp_path / f"packed{batch}", overrides=overrides, batch=batch)
    assert "RecursionError" in rows_in(tmp_path / "packed1")[0]["error"]
    assert rows_in(tmp_path / "packed1") == rows_in(tmp_path / "packed2")


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


def test_a_lost_task_is_tried_again_then_halved_and_at_last_a_failed_row():
    losing, rows = Losing(2), []
    tasks = [Task("x", (), 0, (0, 1, 2, 3), (1, 2, 3, 4)), Task("x", (), 1, (4,), (1,))]
    assert execute(tasks, losing, lambda _, result: rows.extend(result.rows))
    assert sorted((row["run"], row["ended"]) for row in rows) == [
        (0, "duration"), (1, "duration"), (2, "failed"), (3, "duration"), (4, "duration")
    ]  # fmt: skip
    assert losing.tried.count((0, 1, 2, 3)) == losing.tried.count((2, 3)) == losing.tried.count((2,)) == 2
    assert [row["error"] for row in rows if row["run"] == 2] == ["gone"]


def test_who_stops_it_leaves_the_rest_undone():
    losing, rows = Losing(), []
    tasks = [Task("x", (), 0, (run,), (run + 1,)) for run in range(5)]
    assert not execute(tasks, losing, lambda _, result: rows.extend(result.rows), lambda: len(rows) >= 2)
    assert len(rows) == 2
