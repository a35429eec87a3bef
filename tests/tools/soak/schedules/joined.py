"""Schedules of a world whose runners come from elsewhere, in lockstep or in real time, perhaps by way of a router."""

import os
import tempfile
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path

from swarmwire.deploy.config import Listening, Recording
from swarmwire.deploy.simulation import Simulation, finished
from tests.tools.soak import invariants
from tests.tools.soak.place import SCENARIO, environment
from tests.tools.soak.schedules.actors import Actors
from tests.tools.soak.schedules.plan import ROBOTS, TIMEOUT_S, Plan

RATE_HZ = 10


def play_joined(plan: Plan, folder: Path) -> list[str]:
    """What held; Broken if something did not."""
    with own_temporary(folder / "tmp") as env:
        actors = Actors(plan, folder, env)
        simulation = Simulation(
            SCENARIO,
            overrides=overrides(plan),
            out=folder / "run",
            realtime=plan.speed if plan.family == "real time" else None,
            record=Recording(rrd=False),
            listening=Listening(("tcp/127.0.0.1:0",), start_with=_start_with(plan), observer=actors),
        )
        if plan.family != "real time":
            simulation.controls.set_speed(plan.speed)
        simulation.watch(actors)
        actors.start()
        try:
            result = finished(simulation)
        finally:
            actors.close()
        told = [f"{result.ticks} ticks, {result.ended}"]
        if (result.ended, result.ticks) != ("duration", plan.ticks):
            raise invariants.Broken(f"it ended as {result.ended} after {result.ticks} of {plan.ticks} ticks")
        return told + held(plan, folder)


def held(plan: Plan, folder: Path) -> list[str]:
    """The invariants of a run that ended."""
    run = folder / "run"
    summary = invariants.read_summary(run)
    robots = [f"swarm-{at}" for at in range(ROBOTS)]
    return [
        invariants.fates_add_up(summary),
        invariants.owners_are_known(summary, robots, all_played=not plan.late),
        invariants.folder_is_whole(run),
        invariants.undisturbed(run) if plan.family == "wait" else invariants.repeats(run),
        *nothing_left(folder),
    ]


def nothing_left(folder: Path, *, killed: bool = False) -> list[str]:
    """Neither processes nor files, but what a killed world leaves to the next."""
    temporary = folder.absolute() / "tmp"
    return [invariants.nobody_is_left(temporary, os.getpid()), invariants.nothing_is_left(temporary, killed=killed)]


def overrides(plan: Plan) -> list[str]:
    """The scenario's values."""
    return [
        f"robots.swarm.count={ROBOTS}",
        "robots.swarm.place={ how = 'disc', radius_m = 2.0 }",
        f"duration_s={plan.ticks / RATE_HZ}",
        f"run.on_runner_loss={plan.on_loss}",
        f"run.runner_timeout_s={TIMEOUT_S}",
    ]


@contextmanager
def own_temporary(temporary: Path) -> Generator[Mapping[str, str]]:
    """The environment of a schedule, whose temporary files, also those of this process, are in a folder of its own."""
    env = environment(temporary.absolute())
    before, os.environ["XDG_RUNTIME_DIR"] = os.environ.get("XDG_RUNTIME_DIR"), env["XDG_RUNTIME_DIR"]
    tempfile.tempdir, cached = env["TMPDIR"], tempfile.tempdir
    try:
        yield env
    finally:
        tempfile.tempdir = cached
        if before is None:
            del os.environ["XDG_RUNTIME_DIR"]
        else:
            os.environ["XDG_RUNTIME_DIR"] = before


def _start_with(plan: Plan) -> int | None:
    return sum(plan.robots[: len(plan.robots) - plan.late]) if plan.late else None
