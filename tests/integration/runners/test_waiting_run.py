"""A run that waits for its runners says so, and is controlled meanwhile; who asks for another is told."""

import signal
import threading
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from swarmwire.agent.joining import JoinSettings, join
from swarmwire.agent.runner import Arrivals
from swarmwire.comms.errors import BadInput, Interrupted, RunnerLost
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import closed_after, listens_at, open_world
from swarmwire.deploy.config import Listening, Recording
from swarmwire.deploy.control.remote_control import RemoteControl, controlling
from swarmwire.deploy.control.run_finder import Announced, found_runs
from swarmwire.deploy.live.following import read_live
from swarmwire.deploy.simulation import Simulation, finished
from tests.support.deploy.commands import LOSSY
from tests.support.deploy.joiners import HERE, Joiners
from tests.support.waiting import until


@pytest.fixture
def joiners(tmp_path) -> Iterator[Joiners]:
    found = Joiners(tmp_path)
    yield found
    found.close()


@contextmanager
def listening(
    folder: Path, joiners: Joiners, *overrides: str
) -> Generator[tuple[Simulation, RemoteControl, list[str]]]:
    """A run that listens for runners in a thread, control over it, and, once it is over, the error that ended it."""
    simulation = Simulation(
        LOSSY,
        overrides=[*joiners.overrides, *overrides],
        out=folder,
        listening=Listening(HERE, observer=joiners),
        record=Recording(rrd=False, tables=False),
    )
    simulation.watch(Announced(folder))
    errors: list[str] = []

    def run() -> None:
        try:
            finished(simulation)
        except Interrupted as error:
            errors.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        live = until(lambda: read_live(folder))
        assert live is not None
        with controlling(live.endpoint, live.run) as control:
            yield simulation, control, errors
    finally:
        simulation.controls.quit()
        thread.join()


def waits(control: RemoteControl) -> str:
    """For whom a run waits, once it says that it does."""
    return until(control.status, lambda status: status["state"] == "waiting")["runners"]["waits_for"]


def test_a_run_that_waits_for_its_first_agents_is_found_controlled_and_stopped(tmp_path, joiners):
    with listening(tmp_path / "run", joiners) as (simulation, control, errors):
        until(lambda: simulation.run_id in [run.run for run in found_runs()])
        assert waits(control) == "whoever plays flock-0 … flock-19 (20 robots)"
        control.step(2)
        control.event({"do": "kill", "robots": {"names": ["flock-3"]}})
        joiners.start("a")
        status = until(control.status, lambda status: (status["state"], status["tick"]) == ("paused", 2))
        assert status["alive"] == 19
    assert errors == []
    with listening(tmp_path / "other", joiners) as (simulation, control, errors):
        control.stop()
        until(lambda: errors)
    assert errors == ["interrupted while it waited for its runners"]
    assert read_live(tmp_path / "other") is None
    assert simulation.run_id not in [run.run for run in found_runs()]


def test_a_run_that_waits_for_a_runner_that_is_frozen_or_lost_says_for_whom(tmp_path, joiners):
    joiners.first = [("a",)]
    with listening(tmp_path / "run", joiners, "run.on_runner_loss=wait", "duration_s=5000") as (_, control, _):
        until(control.status, lambda status: status["tick"] > 3)
        joiners.send("a", signal.SIGSTOP)
        assert waits(control) == "a, which plays flock-0 … flock-19 (20 robots)"
        joiners.send("a", signal.SIGCONT)
        until(control.status, lambda status: status["state"] == "running")
        joiners.send("a", signal.SIGKILL)
        until(control.status, lambda status: status["runners"]["lost"] == 1)
        assert waits(control) == "whoever plays flock-0 … flock-19 (20 robots)"


def test_a_run_that_is_not_at_the_endpoint_is_told_with_those_that_are():
    with closed_after(open_world("tcp/127.0.0.1:0", 10.0)) as world:
        endpoint = listens_at(world)[0]
        token = world.liveliness().declare_token(Keys("3f2a").world)
        with pytest.raises(BadInput, match=r"--run: expected one of the runs at .*: 3f2a, got 1234"):
            join(JoinSettings(endpoint, run="1234", name="a"), Arrivals(), print)
        with pytest.raises(RunnerLost, match="told nothing of its run"):  # this one is asked
            join(JoinSettings(endpoint, run="3f2a", name="a"), Arrivals(), print)
        token.undeclare()
