"""Plays one schedule of faults, and checks its invariants: `play`."""

import os
import signal
import tempfile
import threading
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil

from swarmwire.comms.base.errors import RunnerLost
from swarmwire.deploy import repeat, sweep
from swarmwire.deploy.runs.config import Listening, Recording
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.metrics.records.run_folder.layout import DIGESTS
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.clocks import until
from tests.support.deploy.campaign import rows_in, scenario_in, series_in
from tests.tools.soak import invariants
from tests.tools.soak.actors import Actors, Nursed
from tests.tools.soak.invariants import Broken, Late
from tests.tools.soak.plan import ROBOTS, TIMEOUT_S, Plan
from tests.tools.soak.processes import PYTHON, SCENARIO, Supervised, environment, family

RATE_HZ = 10
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
ENDS = {signal.SIGKILL: -9, signal.SIGTERM: 130, signal.SIGINT: 130, signal.SIGHUP: 129}
BEGIN_S, END_S = 240.0, 120.0  # on a machine that is busy
EACH_S = 0.02
SEEDS, LOSSES = 6, [0.0, 0.5]
LONG = "duration_s=20"
MAX_KILLS = 3
LIMIT_S = 240.0
STACKS_S = 10.0  # time for an aborted process to write its stacks


def play(plan: Plan, folder: Path) -> list[str]:
    """Passed checks of a schedule, a line each; its files stay in the folder.

    Broken if an invariant did not hold, Late if a time limit passed.
    """
    players = {"own runners": _play_own_runners, "world killed": _play_killed_world, "campaign": _play_campaign}
    return players.get(plan.family, _play_joined)(plan, folder)


def _play_joined(plan: Plan, folder: Path) -> list[str]:
    """Passed checks; Broken if a check failed."""
    with temporary_folder(folder / "tmp") as env:
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
            result = run_to_end(simulation)
        finally:
            actors.close()
        passed = [f"{result.ticks} ticks, {result.ended}"]
        if (result.ended, result.ticks) != ("duration", plan.ticks):
            raise invariants.Broken(f"it ended as {result.ended} after {result.ticks} of {plan.ticks} ticks")
        return passed + passed_checks(plan, folder)


def passed_checks(plan: Plan, folder: Path) -> list[str]:
    """The invariants of a run that ended."""
    run = folder / "run"
    summary = invariants.read_summary(run)
    robots = [f"swarm-{at}" for at in range(ROBOTS)]
    return [
        invariants.check_fates(summary),
        invariants.check_owners(summary, robots, all_played=not plan.late),
        invariants.check_folder(run),
        invariants.check_undisturbed(run) if plan.family == "wait" else invariants.check_repeat(run),
        *check_no_leftovers(folder),
    ]


def check_no_leftovers(folder: Path, *, killed: bool = False) -> list[str]:
    """Check for processes and files, except those that a killed world leaves to the next."""
    temporary = folder.absolute() / "tmp"
    return [invariants.check_no_process(temporary, os.getpid()), invariants.check_no_file(temporary, killed=killed)]


def overrides(plan: Plan) -> list[str]:
    """Overrides of the scenario."""
    return [
        f"robots.swarm.count={ROBOTS}",
        "robots.swarm.place={ how = 'disc', radius_m = 2.0 }",
        f"duration_s={plan.ticks / RATE_HZ}",
        f"run.on_runner_loss={plan.on_loss}",
        f"run.runner_timeout_s={TIMEOUT_S}",
    ]


@contextmanager
def temporary_folder(temporary: Path) -> Generator[Mapping[str, str]]:
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


def _play_own_runners(plan: Plan, folder: Path) -> list[str]:
    """Passed checks; Broken if a check failed."""
    with temporary_folder(folder / "tmp") as env:
        actors = Nursed(plan, folder, env)
        simulation = Simulation(
            SCENARIO,
            overrides=overrides(plan),
            out=folder / "run",
            runners=len(plan.robots),
            record=Recording(rrd=False),
        )
        simulation.controls.set_speed(plan.speed)
        simulation.watch(actors)
        for runner in actors.runners.values():
            runner.stay_away()
        actors.start()
        failed = ""
        try:
            run_to_end(simulation)
        except RunnerLost as error:
            failed = str(error)
        finally:
            actors.close()
        summary = invariants.read_summary(folder / "run")
        expected = "failed" if failed else "duration"
        if summary["ended"] != expected or (failed and plan.on_loss != "stop"):
            raise invariants.Broken(f"it ended as {summary['ended']}: {failed or summary['error']}")
        run = folder / "run"
        robots = [f"swarm-{at}" for at in range(ROBOTS)]
        return [
            f"{summary['ticks']} ticks, {summary['ended']}",
            invariants.check_fates(summary),
            "no owners" if failed else invariants.check_owners(summary, robots, has_own_runners=True),
            invariants.check_folder(run),
            invariants.check_repeat(run) if summary["ticks"] else "no tick to repeat",
            *check_no_leftovers(folder),
        ]


def _play_killed_world(plan: Plan, folder: Path) -> list[str]:
    """Passed checks; Broken if a check failed."""
    rng = np.random.default_rng([plan.seed, 13])
    number, after_s = SIGNALS[int(rng.integers(len(SIGNALS)))], float(rng.uniform(0.0, 3.0))
    with temporary_folder(folder / "tmp") as env:
        sets = [word for override in overrides(plan) for word in ("--set", override)]
        command = (*PYTHON, "swarmwire.deploy", "run", str(SCENARIO), *sets, "--set", "duration_s=1000", "--out",
                   str(folder / "run"), "--runners", str(len(plan.robots)), "--no-rrd")  # fmt: skip
        world = Supervised("world", lambda: command, folder / "world.log", env)
        world.tend(0)
        try:
            _begun(folder / "run" / DIGESTS, world)
            threading.Event().wait(after_s)
            if rng.random() < 0.3:
                world.send(signal.SIGSTOP)
                threading.Event().wait(0.5)
            world.send(number)
            world.send(signal.SIGCONT)
            if not world.ended_within(END_S):
                raise Late(f"the world did not end within {END_S:g} s of {number.name}")
            _await_orphans()
        finally:
            world.kill()
            code = world.end()
        if code != ENDS[number]:
            raise Broken(f"{number.name}: exit code {code}; {(folder / 'world.log').read_text()[-600:]}")
        return [
            f"{number.name} after {after_s:.1f} s",
            *_left_behind(folder, number),
            *check_no_leftovers(folder, killed=number == signal.SIGKILL),
        ]


def _begun(digests: Path, world: Supervised) -> None:
    """Return once the run has ticked; Broken if it ended before, Late if it takes too long."""
    for _ in range(int(BEGIN_S / EACH_S)):
        if digests.exists():
            return
        if world.pid is None:
            raise Broken("the world ended before its first tick")
        threading.Event().wait(EACH_S)
    raise Late(f"the run did not begin within {BEGIN_S:g} s")


def _left_behind(folder: Path, number: signal.Signals) -> list[str]:
    run = folder / "run"
    if number != signal.SIGKILL:
        summary = invariants.read_summary(run)
        if summary["ended"] != "interrupted":
            raise Broken(f"it ended as {summary['ended']}")
        return [invariants.check_fates(summary), invariants.check_folder(run), invariants.check_repeat(run)]
    bad = [part for part in verify(run) if part.state in (TableState.DAMAGED, TableState.DIFFERS)]
    if bad:
        raise Broken("; ".join(f"{part.part}: {part.state}, {part.text}" for part in bad))
    for path in (folder / "tmp" / "own" / "swarmwire").glob("*.json"):
        path.unlink()  # the next search for runs removes them
    again = repeat(run)
    if again.same is False:
        raise Broken(f"repeat differs from tick {again.first_difference} on")
    return ["what is left of the folder can be read", f"repeated {again.compared} ticks, the same"]


def _play_campaign(plan: Plan, folder: Path) -> list[str]:
    """Passed checks; Broken if a check failed."""
    rng = np.random.default_rng([plan.seed, 14])
    with temporary_folder(folder / "tmp") as env:
        scenario, campaign = scenario_in(folder), folder / "campaign"
        arguments = (str(scenario), "--vary", "radio.loss=0,0.5", "--seeds", str(SEEDS), "--set", LONG, "--batch", "2",
                 "--out", str(campaign))  # fmt: skip
        breaks: list[str] = []

        def start(command_arguments: Sequence[str]) -> Supervised:
            command = (*PYTHON, "swarmwire.deploy", "sweep", *command_arguments, "--workers", "2", "--quiet")
            sweep_process = Supervised(
                "sweep", lambda: command, folder / "sweep.log", {**env, "PYTHONFAULTHANDLER": "1"}
            )
            sweep_process.tend(0)
            return sweep_process

        def resumed() -> Sequence[str]:
            return ("--resume", str(campaign), "--retry-failed") if (campaign / "campaign.json").exists() else arguments

        for _ in range(int(rng.integers(1, MAX_KILLS + 1))):
            process = start(resumed())
            try:
                threading.Event().wait(float(rng.uniform(0.5, 7.0)))
                breaks.append(_break(process, rng))
                _await_end(process, folder / "sweep.log")
                _await_orphans()
            finally:
                process.kill()
                process.end()
        last = start(resumed())
        try:
            _await_end(last, folder / "sweep.log")
        finally:
            last.kill()
            code = last.end()
        if code != 0:
            raise Broken(f"the last resume ended with {code}: {(folder / 'sweep.log').read_text()[-600:]}")
        return [", ".join(breaks), each_run_once(campaign, scenario, folder / "whole"), *check_no_leftovers(folder)]


def each_run_once(campaign: Path, scenario: Path, undisturbed: Path) -> str:
    """The campaign's tables have each run exactly once, as those of one that was left alone."""
    sweep(scenario, out=undisturbed, seeds=SEEDS, vary={"radio.loss": LOSSES}, overrides=[LONG], batch=2, workers=1)
    got, expected = rows_in(campaign), rows_in(undisturbed)
    numbers = [row["run"] for row in got]
    if sorted(numbers) != list(range(SEEDS * len(LOSSES))):
        raise Broken(f"the table has the runs {sorted(numbers)}")
    if got != expected:
        raise Broken("rows differ from those of a campaign that was left alone")
    if not series_in(campaign).equals(series_in(undisturbed), null_equal=True):
        raise Broken("series differ from those of a campaign that was left alone")
    return f"{len(numbers)} runs, each once, the same as without faults"


def _await_end(process: Supervised, log: Path) -> None:
    """Return when it has ended; Late, with where each of its threads stood, if it takes too long."""
    if process.ended_within(LIMIT_S):
        return
    if process.pid is not None:
        for child in family(process.pid):
            with suppress(psutil.NoSuchProcess):  # may end at this moment
                child.send_signal(signal.SIGABRT)
    process.send(signal.SIGABRT)
    process.ended_within(STACKS_S)
    raise Late(f"the campaign did not end within {LIMIT_S:g} s: {log.read_text(errors='replace')[-6000:]}")


def _await_orphans() -> None:
    """Return when all child processes have ended; Late after a minute."""
    try:
        until(
            lambda: (
                not [
                    process for process in family(os.getpid()) if process.is_running() and process.status() != "zombie"
                ]
            )
        )
    except AssertionError as error:
        raise Late(f"processes outlive theirs: {error}") from None


def _break(process: Supervised, rng: np.random.Generator) -> str:
    if rng.random() < 0.5 and process.pid is not None:
        workers = family(process.pid)
        if workers:
            workers[int(rng.integers(len(workers)))].kill()
            return "worker killed"
    number = (signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM)[int(rng.integers(4))]
    process.send(number)
    return f"campaign {number.name}"
