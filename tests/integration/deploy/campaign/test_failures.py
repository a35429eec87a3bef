"""What fails is a row that says why, and stops nothing else."""

from swarmwire.deploy import sweep
from tests.support.deploy.campaign import rows_in, series_in


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
