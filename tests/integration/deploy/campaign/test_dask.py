"""Campaigns on a dask cluster: the rows are those of this machine, whoever comes, goes or dies meanwhile."""

import os
import re
import signal
import socket
from pathlib import Path

import psutil
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import resume, sweep
from swarmwire.deploy.campaign import dask_executor, execution, sweeping
from swarmwire.deploy.campaign.campaign import read_campaign
from swarmwire.deploy.campaign.campaign_folder import CampaignFolder
from swarmwire.deploy.campaign.cluster_failed import ClusterFailed
from swarmwire.deploy.campaign.dask_executor import DaskExecutor
from swarmwire.deploy.terminal import sweep_progress
from tests.support.deploy.campaign.cluster import children, cluster
from tests.support.deploy.campaign.small import InThisProcess, rows_in, scenario_in, series_in
from tests.support.deploy.commands import called

ASKED = {"seeds": 4, "vary": {"radio.loss": [0.0, 0.5]}, "batch": 2}


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """A campaign on this machine; of its seeds some fail."""
    folder = tmp_path_factory.mktemp("reference")
    scenario_in(folder, "stumbling.py:Stumbling")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        assert sweep(folder / "two.toml", out=folder / "c", **ASKED).failed
    return folder


@pytest.fixture(scope="module")
def two_threads(tmp_path_factory):
    """A worker with two threads."""
    with cluster(tmp_path_factory.mktemp("cluster"), 2) as found:
        yield found


class Watcher:
    """Looks on, and does something when the first task is done."""

    def __init__(self, act=lambda: None):
        self.act, self.tasks = act, 0

    def begin(self, campaign, done, failed):
        pass

    def see(self, result):
        self.tasks += 1
        if self.tasks == 1:
            self.act()

    def end(self):
        pass


def workers_of(folder):
    return set(CampaignFolder(folder, read_campaign(folder)).rows()["machine_worker"])


def same(folder, reference):
    assert rows_in(folder) == rows_in(reference / "c")
    assert series_in(folder).equals(series_in(reference / "c"), null_equal=True)


def test_a_cluster_gives_the_rows_and_series_of_one_machine(tmp_path, reference, two_threads):
    done = sweep(reference / "two.toml", out=tmp_path / "c", on=two_threads.on, **ASKED)
    assert done.is_over
    same(tmp_path / "c", reference)
    (worker,) = workers_of(tmp_path / "c")
    assert worker.startswith("tcp://127.0.0.1:")
    assert len(children(two_threads.workers[0])) == 2


def test_an_agent_that_kills_its_process_ends_no_worker(tmp_path, reference, two_threads):
    kill = ['robots.pair.params.how="kill"']
    sweep(reference / "two.toml", seeds=2, out=tmp_path / "c", on=two_threads.on, workers=1, batch=1, overrides=kill)
    assert [row["error"] for row in rows_in(tmp_path / "c")] == [None, "the worker died, signal 9"]
    assert two_threads.workers[0].is_running()


def test_ctrl_c_ends_what_is_under_way_on_the_workers(tmp_path, reference, two_threads, monkeypatch):
    long, busy = ["duration_s=100000", "robots.pair.params.share=0.0"], list[psutil.Process]()
    monkeypatch.setattr(sweeping, "execute", interrupted_once_at_work(two_threads.workers[0], busy))
    done = sweep(reference / "two.toml", seeds=2, out=tmp_path / "c", on=two_threads.on, workers=1, overrides=long)
    assert (done.done, done.is_over) == (0, False)
    assert len(busy) == 1
    assert psutil.wait_procs(busy, timeout=30)[1] == []


def interrupted_once_at_work(worker, busy):
    """`execute`, with a Ctrl-C as soon as a process of the worker's has worked for a while."""
    execute, before = execution.execute, children(worker)

    def execute_interrupted(tasks, executor, keep, stopped):
        def asked():
            found = [child for child in children(worker) if child not in before]
            if found and found[0].cpu_times().user > 0.5 and not busy:
                busy.extend(found)
                os.kill(os.getpid(), signal.SIGINT)
            return stopped()

        return execute(tasks, executor, keep, asked)

    return execute_interrupted


def test_a_worker_that_is_killed_in_the_middle_costs_no_run(tmp_path, reference):
    with cluster(tmp_path, 1) as there:
        gone = []

        def kill_it():
            there.add_worker()  # which joins a campaign that has begun
            gone.extend(children(there.workers[0]))
            there.workers[0].kill()

        watcher = Watcher(kill_it)
        done = sweep(reference / "two.toml", out=tmp_path / "c", on=there.on, watcher=watcher, **{**ASKED, "batch": 1})
        assert done.is_over
        assert len(workers_of(tmp_path / "c")) == 2
        assert psutil.wait_procs(gone, timeout=30)[1] == []
    same(tmp_path / "c", reference)


@pytest.mark.slow  # dask waits five seconds at least
def test_a_worker_that_is_frozen_is_given_up_and_costs_no_run(tmp_path, reference, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL", "5s")  # in place of five minutes
    with cluster(tmp_path, 1) as there:

        def freeze_it():
            there.add_worker()
            there.workers[0].suspend()

        watcher = Watcher(freeze_it)
        done = sweep(reference / "two.toml", out=tmp_path / "c", on=there.on, watcher=watcher, **{**ASKED, "batch": 1})
        assert done.is_over
        assert len(workers_of(tmp_path / "c")) == 2
    same(tmp_path / "c", reference)


def test_a_scheduler_that_is_killed_is_one_line_and_the_rest_is_done_here(
    tmp_path, reference, monkeypatch, capsys, caplog
):
    folder = tmp_path / "c"
    with cluster(tmp_path, 1) as there:
        monkeypatch.setattr(sweep_progress, "sweep_progress", lambda _: Watcher(there.scheduler.kill))
        vary, batch = ("--vary", "radio.loss=0.0,0.5"), ("--batch", "1")
        code, _, errors = called(
            monkeypatch, capsys, "sweep", reference / "two.toml", *vary, "--seeds", "4", *batch, "--out", folder,
            "--on", there.on,
        )  # fmt: skip
    assert (code, caplog.text) == (1, "")
    told = f"error: {there.on}: .*--resume {folder}.*--on local"
    assert [line for line in errors.splitlines() if "waiting" not in line] == [errors.splitlines()[-1]]
    assert re.fullmatch(told, errors.splitlines()[-1])
    assert 1 <= len(rows_in(folder)) < 8
    with monkeypatch.context() as patched:
        patched.setattr(sweeping, "open_executor", lambda *_: InThisProcess())
        assert resume(folder).is_over
    same(folder, reference)


def test_a_scheduler_that_is_frozen_is_given_up_in_a_line(tmp_path, reference, two_threads, monkeypatch):
    monkeypatch.setattr(dask_executor, "POLL_S", 0.1)
    monkeypatch.setattr(dask_executor, "MUTE_LOOKS", 3)
    long, freeze = ["duration_s=100000", "robots.pair.params.share=0.0"], two_threads.scheduler.suspend
    monkeypatch.setattr(sweeping, "execute", first_calls(freeze))
    try:
        with pytest.raises(ClusterFailed, match="--resume"):
            sweep(reference / "two.toml", seeds=2, out=tmp_path / "c", on=two_threads.on, workers=1, overrides=long)
    finally:
        two_threads.scheduler.resume()


def first_calls(act):
    """`execute`, with an act before it."""

    def execute_after(*given):
        act()
        return execution.execute(*given)

    return execute_after


def test_without_workers_or_with_one_of_another_version_nothing_begins(tmp_path, reference):
    odd, told = tmp_path / "odd.py", []
    odd.write_text(
        "from swarmwire.deploy.record import machine\n"
        "found = machine.versions()\nmachine.versions = lambda: {**found, 'numpy': '1.0'}\n"
    )
    with cluster(tmp_path) as there:
        with pytest.raises(ClusterFailed, match=rf"^{there.on}: .*0\.1 s"):
            DaskExecutor(there.on, None, Path(), say=told.append, patience_s=0.1)
        assert len(told) == 1
        assert told[0].startswith(f"{there.on}: ")
        there.add_worker(preload=odd)
        with pytest.raises(BadInput, match=r"numpy.* 1\.0") as refused:
            sweep(reference / "two.toml", seeds=1, out=tmp_path / "c", on=there.on)
        assert refused.value.where == "--on"
        assert not (tmp_path / "c").exists()


def test_a_scheduler_out_of_reach_is_one_line(caplog):
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        on = f"dask://127.0.0.1:{nobody.getsockname()[1]}"
        with pytest.raises(ClusterFailed, match=f"^{on}: ") as failed:
            DaskExecutor(on, None, Path(), connect_s=0.5)
    assert "\n" not in str(failed.value)
    assert caplog.text == ""
