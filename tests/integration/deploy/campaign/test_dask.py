"""Campaigns on a dask cluster: the rows are those of this machine, whichever workers come, go or die meanwhile."""

import asyncio
import os
import re
import signal
import socket
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaigns import dask, schedule
from swarmwire.deploy.campaigns import sweep as sweeping
from swarmwire.deploy.campaigns.dask import ClusterFailed, DaskExecutor
from swarmwire.deploy.campaigns.schedule import execute, tasks_of
from swarmwire.deploy.campaigns.store import CampaignWriter
from swarmwire.deploy.campaigns.sweep import NoObserver
from swarmwire.deploy.cli.actions import sweep as sweep_action
from swarmwire.metrics.records.campaign.campaign_json import read_campaign
from tests.support.deploy.campaign import InThisProcess, children, cluster, rows_in, scenario_in, series_in
from tests.support.deploy.runs import called
from tests.support.refusals import refused_input

OPTIONS = {"seeds": 4, "vary": {"radio.loss": [0.0, 0.5]}, "batch": 2}
SINGLE = {**OPTIONS, "batch": 1}
LONG = ["duration_s=100000", "robots.pair.params.share=0.0"]
ODD = """
from swarmwire.deploy.runs.record import provenance
found = provenance.versions()
provenance.versions = lambda: {**found, 'numpy': '1.0'}
"""
HANGING = """
from swarmwire.agent import Agent
class Hanging(Agent):
    def step(self, robot):
        while True: pass
"""


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """A campaign on this machine; of its seeds some fail."""
    folder = tmp_path_factory.mktemp("reference")
    scenario_in(folder, "stumbling.py:Stumbling")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        assert sweep(folder / "two.toml", out=folder / "c", **OPTIONS).failed
    return folder


@pytest.fixture(scope="module")
def one_worker(tmp_path_factory):
    """A cluster that gives a task of which a worker dies to no other."""
    settings = {"DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"}
    with cluster(tmp_path_factory.mktemp("cluster"), 1, **settings) as opened:
        yield opened


class Observer(NoObserver):
    """Does something when the first task is done."""

    def __init__(self, act):
        self.acts = [act]

    def see(self, result):
        while self.acts:
            self.acts.pop()()


def swept(reference, folder, cluster, **options):
    """The campaign `c` in this folder, done by a cluster."""
    return sweep(reference / "two.toml", out=folder / "c", executor=cluster.name, **options)


def workers_of(folder):
    return set(CampaignWriter(folder, read_campaign(folder)).rows()["machine_worker"])


def same(folder, reference):
    assert rows_in(folder) == rows_in(reference / "c")
    assert series_in(folder).equals(series_in(reference / "c"), null_equal=True)


def test_dask_cluster_gives_the_rows_and_series_of_one_machine(tmp_path, reference, one_worker):
    assert swept(reference, tmp_path, one_worker, **OPTIONS).is_over
    same(tmp_path / "c", reference)
    (worker,) = workers_of(tmp_path / "c")
    assert worker.startswith("tcp://127.0.0.1:")
    local = Path(one_worker.nannies[0].cwd())
    assert not list(local.rglob("two.toml")) + list(local.rglob("stumbling.py"))


def test_agent_that_kills_its_process_costs_its_run_alone(tmp_path, reference, one_worker):
    swept(reference, tmp_path, one_worker, seeds=2, batch=2, overrides=['robots.pair.params.how="kill"'])
    assert [row["error"] for row in rows_in(tmp_path / "c")] == [None, "the worker died"]
    assert one_worker.nannies[0].is_running()


def test_ctrl_c_ends_what_is_under_way_on_the_workers(tmp_path, reference, one_worker, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(sweeping, "execute", interrupted_once_at_work(one_worker.nannies[0]))
        done = swept(reference, tmp_path / "first", one_worker, seeds=2, overrides=LONG)
    assert (done.done, done.is_over) == (0, False)
    # The worker does one task at a time: another campaign ends only if the run of 100,000 s is no more.
    assert swept(reference, tmp_path, one_worker, **OPTIONS).is_over
    same(tmp_path / "c", reference)


def interrupted_once_at_work(nanny):
    """`execute`, with a Ctrl-C as soon as the nanny's worker has worked for a while."""

    def worked_s():
        return sum(child.cpu_times().user for child in children(nanny))

    def execute_interrupted(tasks, executor, keep, stopped):
        before, sent = worked_s(), []

        def interrupted():
            if worked_s() > before + 0.5 and not sent:
                sent.append(os.kill(os.getpid(), signal.SIGINT))
            return stopped()

        return execute(tasks, executor, keep, interrupted)

    return execute_interrupted


def test_worker_that_is_killed_in_the_middle_costs_no_run(tmp_path, reference):
    with cluster(tmp_path, 1) as opened:
        processes = []

        def kill_it():
            opened.add_worker()  # which joins a campaign that has begun
            processes.extend(children(opened.nannies[0]))
            opened.nannies[0].kill()

        assert swept(reference, tmp_path, opened, observer=Observer(kill_it), **SINGLE).is_over
        assert len(workers_of(tmp_path / "c")) == 2
        assert psutil.wait_procs(processes, timeout=30)[1] == []
    same(tmp_path / "c", reference)


@pytest.mark.slow  # dask waits fifteen seconds at least
def test_worker_that_is_frozen_is_given_up_and_costs_no_run(tmp_path, reference):
    with cluster(tmp_path, 1, DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL="15s") as opened:  # in place of five minutes

        def freeze_it():
            opened.add_worker()
            for child in children(opened.nannies[0]):
                child.suspend()

        assert swept(reference, tmp_path, opened, observer=Observer(freeze_it), **SINGLE).is_over
        assert len(workers_of(tmp_path / "c")) == 2
    same(tmp_path / "c", reference)


def test_run_that_stands_still_ends_its_worker_and_is_a_failed_row(tmp_path, reference):
    (tmp_path / "short.py").write_text("from swarmwire.deploy.campaigns import dask\ndask.MAX_SILENCE_S = 3.0\n")
    (reference / "hanging.py").write_text(HANGING)
    with cluster(tmp_path, 0, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="0") as opened:
        opened.add_worker(preload=tmp_path / "short.py")
        done = swept(reference, tmp_path, opened, seeds=1, overrides=['robots.pair.agent="hanging.py:Hanging"'])
    assert (done.is_over, done.failed) == (True, 1)
    assert rows_in(tmp_path / "c")[0]["error"] == "the worker died"


def test_scheduler_that_is_killed_is_one_line_and_the_sweep_resumes_here(
    tmp_path, reference, monkeypatch, capsys, caplog
):
    folder = tmp_path / "c"
    with cluster(tmp_path, 1) as opened:
        monkeypatch.setattr(sweep_action, "SweepProgress", lambda _: Observer(opened.scheduler.kill))
        options = ["--vary", "radio.loss=0.0,0.5", "--seeds", "4", "--batch", "1", "--executor"]
        command = ("sweep", reference / "two.toml", "--out", folder, *options, opened.name)
        code, _, errors = called(monkeypatch, capsys, *command)
    assert (code, caplog.text) == (1, "")
    pattern = f"error: {opened.name}: .*--resume {folder}.*--executor local"
    assert [line for line in errors.splitlines() if "waiting" not in line] == [errors.splitlines()[-1]]
    assert re.fullmatch(pattern, errors.splitlines()[-1])
    assert 1 <= len(rows_in(folder)) < 8
    with monkeypatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        assert resume(folder).is_over
    same(folder, reference)


def test_scheduler_that_is_frozen_is_given_up_in_a_line(tmp_path, reference, one_worker, monkeypatch):
    monkeypatch.setattr(dask, "POLL_S", 0.1)
    monkeypatch.setattr(dask, "CLOSE_S", 0.5)
    monkeypatch.setattr(dask, "PREPARE_S", 1.0)
    monkeypatch.setattr(dask, "MAX_MUTE_POLLS", 3)
    frozen = one_worker.scheduler.suspend
    monkeypatch.setattr(sweeping, "execute", lambda *arguments: [frozen(), schedule.execute(*arguments)][1])
    try:
        with pytest.raises(ClusterFailed, match="--resume"):
            swept(reference, tmp_path, one_worker, seeds=2, overrides=LONG)
    finally:
        one_worker.scheduler.resume()


def test_without_workers_or_with_one_of_another_version_nothing_begins(tmp_path, reference):
    (tmp_path / "odd.py").write_text(ODD)
    lines = []
    with cluster(tmp_path, 0) as opened:
        with pytest.raises(ClusterFailed, match=rf"^{opened.name}: .*0\.1 s"):
            DaskExecutor(opened.name, None, Path(), report=lines.append, no_worker_s=0.1)
        assert [line.startswith(f"{opened.name}: ") for line in lines] == [True]
        opened.add_worker(preload=tmp_path / "odd.py")
        with refused_input("executor", match=r"numpy.* 1\.0"):
            swept(reference, tmp_path, opened, seeds=1)
        assert not (tmp_path / "c").exists()


def test_worker_of_another_version_that_joins_later_is_left_out(tmp_path, reference):
    (tmp_path / "odd.py").write_text(ODD)
    folder, lines, rows = CampaignWriter(reference / "c", read_campaign(reference / "c")), [], []
    tasks = tasks_of(folder.campaign, folder, (), 1, 1)
    with cluster(tmp_path, 1) as opened:
        executor = DaskExecutor(opened.name, None, folder.scenario.parent, report=lines.append)

        def keep(_, result):
            rows.extend(result.rows)
            if len(rows) == 1:
                opened.add_worker(preload=tmp_path / "odd.py")

        try:
            assert execute(tasks[:1], executor, keep)
            while not any("left out" in line for line in lines):
                executor.finished(0.1)
            assert execute(tasks[1:], executor, keep)
        finally:
            executor.close()
    assert "numpy is 1.0" in lines[-1]
    assert len(rows) == 8
    assert len({row["machine_worker"] for row in rows}) == 1


def test_worker_takes_the_functions_that_this_machine_has_compiled(tmp_path, monkeypatch):
    archives = list[bytes]()
    monkeypatch.setattr(dask, "read_archive", lambda path: archives.append(path.read_bytes()))

    async def set_resources(**resources: int) -> None:
        assert resources == {"campaign": 1}

    names = {"address": "", "local_directory": tmp_path, "log_event": lambda *_: None, "status": None}
    worker = SimpleNamespace(set_resources=set_resources, **names)
    asyncio.run(dask.Preparation("campaign", dask.environment(), {dask.KERNELS: b"compiled"}).setup(worker))
    assert archives == [b"compiled"]


def test_scheduler_out_of_reach_is_one_line(caplog):
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        name = f"dask://127.0.0.1:{nobody.getsockname()[1]}"
        with pytest.raises(ClusterFailed, match=f"^{name}: ") as failed:
            DaskExecutor(name, None, Path(), connect_s=0.5)
    assert "\n" not in str(failed.value)
    assert caplog.text == ""
