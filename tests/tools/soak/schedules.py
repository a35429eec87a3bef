"""Schedules of faults as Hypothesis state machines: the rules are troubles, the invariants are the accounts of the run.

A schedule is a short run whose processes are killed, frozen, slowed and interrupted, and come back. Hypothesis shrinks
one that fails, and prints its calls. Its files stay in the folder that is printed.
"""

import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from random import Random  # noqa: TID251 - Hypothesis draws by the same interface
from typing import Any

from hypothesis import currently_in_test_context, note
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy import repeat, sweep
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.clocks import until
from tests.support.deploy.campaign import rows_in, scenario_in, series_in
from tests.tools.soak import invariants
from tests.tools.soak.invariants import Broken, processes_with
from tests.tools.soak.processes import PYTHON, Steps, Supervised, environment, family
from tests.tools.soak.site import Course, Kind, Site
from tests.tools.soak.troubles import RUNNER_TROUBLES, WORLD_TROUBLES, Troubles

ROBOTS = 8
TIMEOUT_S = 1.5  # timeout of a runner
SPEED = 2.0  # simulated seconds in a second
# How a run ends, and its exit code.
ENDINGS = {"stop": 130, "SIGKILL": -9, "SIGTERM": 130, "SIGINT": 130, "SIGHUP": 129}

DRAWS = st.randoms(note_method_calls=True)
SHORT_S = st.sampled_from((0.0, 0.1, 0.5, 2.0))


def report(*words: object) -> None:
    """Print what happens in a schedule; of those that Hypothesis draws, only in the one that fails."""
    (note if currently_in_test_context() else print)(" ".join(map(str, words)))


def new_folder() -> Path:
    """A folder for the files of a schedule, which stay if it fails."""
    folder = Path(tempfile.mkdtemp(prefix="schedule-"))
    report("files:", folder)
    return folder


class DisturbedRun(RuleBasedStateMachine):
    """A run whose world and observer are disturbed; subclasses disturb its runners."""

    site: Site

    def start(self, kind: Kind, on_loss: str, ending: str, options: Sequence[str] = ()) -> None:
        """Start all, until the first tick is over."""
        self.folder = new_folder()
        self.temporary = self.folder.absolute() / "tmp"
        self.on_loss, self.ending = on_loss, ending
        self._last: dict[str, int] = {}
        self.in_real_time = "--realtime" in options
        placement = "robots.swarm.place={ how = 'disc', radius_m = 2.0 }"
        values = (placement, f"run.on_runner_loss={on_loss}", f"run.runner_timeout_s={TIMEOUT_S}")
        sets = [word for value in values for word in ("--set", value)]
        kind = Kind(**{**vars(kind), "options": (*sets, "--no-rrd", *options)})
        self.site = Site(kind, self.folder / "site", environment(self.temporary))
        self.troubles = Troubles(self.site, report, TIMEOUT_S)
        self.site.observe(["observer"])
        self.course = Course(self.site)
        self.course.until(self.status, "the run to begin")
        if not self.in_real_time:
            self.site.ask(lambda run: run.speed(SPEED))
        self.course.until(lambda: (self.status() or {"tick": 0})["tick"] > 0, "the first tick")

    @rule(for_s=SHORT_S)
    def wait(self, for_s: float) -> None:
        """Let the run go on."""
        self.course.pass_time(for_s)

    @rule(trouble=st.sampled_from(list(WORLD_TROUBLES)), draws=DRAWS)
    def disturb_world(self, trouble: str, draws: Random) -> None:
        """Freeze or pause the world, or order an event."""
        self.begin(self.troubles.named(trouble, draws))

    @rule(trouble=st.sampled_from(["observer_killed", "observer_frozen"]), draws=DRAWS)
    def disturb_observer(self, trouble: str, draws: Random) -> None:
        """Kill or freeze the observer."""
        self.begin(self.troubles.named(trouble, draws))

    @invariant()
    def world_goes_on(self) -> None:
        """No trouble ends the world, unless it stops for a lost runner."""
        assert self.on_loss == "stop" or self.site.world.pid is not None, self.site.log_text("world")[-600:]

    @invariant()
    def nothing_crashes(self) -> None:
        """Processes end by request, by a kill, or with a reason; runners and world print no traceback."""
        invariants.check_exit_codes(self.site.exit_codes)
        for process in (*self.site.runners, self.site.world):
            text = self.site.log_text(process.name)
            if "Traceback" in text and "KeyboardInterrupt" not in text:
                raise Broken(f"{process.name}: {text[text.index('Traceback') :][-600:]}")

    @invariant()
    def accounts_go_on(self) -> None:
        """Ticks and counts never fall, and each robot is somebody's or free."""
        status = self.status()
        if status is not None:
            present = {"tick": status["tick"], **status["counts"]}
            fallen = {name: last for name, last in self._last.items() if present.get(name, last) < last}
            assert not fallen, f"{fallen} became {present}"
            assert 0 <= status["runners"]["robots_free"] <= ROBOTS
            self._last = present

    def teardown(self) -> None:
        """End the run, and check what remains of it."""
        if not hasattr(self, "site"):
            return
        has_failed = sys.exc_info()[0] is not None
        try:
            if not has_failed:
                self.course.recover()
                self.course.end(None if self.ending == "stop" else signal.Signals[self.ending])
                self.course.until(lambda: not processes_with(self.temporary), "all processes to end")
                self.check()
        finally:
            self.site.close()
        if not has_failed:
            shutil.rmtree(self.folder)

    def check(self) -> None:
        """The accounts of a run that has ended."""
        run, world = self.site.folder, self.site.world
        was_lost = self.on_loss == "stop" and world.codes == [1]
        if world.codes != [ENDINGS[self.ending]] and not was_lost:
            raise Broken(f"{self.ending}: exit codes {world.codes}; {self.site.log_text('world')[-600:]}")
        self.nothing_crashes()
        if world.codes == [-signal.SIGKILL]:
            self._check_remains(run)
        else:
            summary = invariants.read_summary(run)
            if summary["ended"] != ("failed" if was_lost else "interrupted"):
                raise Broken(f"it ended as {summary['ended']}")
            invariants.check_fates(summary)
            self.check_owners(summary)
            invariants.check_folder(run)
            waits = self.on_loss == "wait" and not self.in_real_time
            (invariants.check_undisturbed if waits else invariants.check_repeat)(run)
        invariants.check_no_process(self.temporary)
        invariants.check_no_file(self.temporary, killed=self.ending == "SIGKILL")

    def check_owners(self, summary: Any) -> None:
        """Check that each robot had one runner."""
        kind = self.site.kind
        names = [f"swarm-{at}" for at in range(ROBOTS)]
        invariants.check_owners(summary, names, all_played=not kind.late, has_own_runners=kind.starts_runners)

    def _check_remains(self, run: Path) -> None:
        """What a killed world leaves can be read and repeated."""
        bad = [part for part in verify(run) if part.state in (TableState.DAMAGED, TableState.DIFFERS)]
        if bad:
            raise Broken("; ".join(f"{part.part}: {part.state}, {part.text}" for part in bad))
        for path in (self.temporary / "own" / "swarmwire").glob("*.json"):
            path.unlink()  # the next search for runs removes them
        again = repeat(run)
        if again.same is False:
            raise Broken(f"repeat differs from tick {again.first_difference} on")

    def begin(self, steps: Steps) -> None:
        """Begin a trouble, which goes on during the next rules."""
        self.course.begin(steps)
        self.wait(0.1)

    def status(self) -> dict[str, Any] | None:
        """The status of the run, if it has one."""
        try:
            return self.site.ask(lambda run: run.status())
        except SwarmwireError:
            return None


class JoinedRunners(DisturbedRun):
    """Runners that join a world, directly or behind a router, before or after its first tick."""

    @initialize(
        on_loss=st.sampled_from(["wait", "coast", "stand"]),
        cuts=st.sets(st.integers(1, ROBOTS - 1), min_size=1, max_size=3),
        late=st.integers(0, 3),
        has_router=st.booleans(),
        in_real_time=st.booleans(),
        ending=st.sampled_from(list(ENDINGS)),
    )
    def start_world(
        self, on_loss: str, cuts: set[int], late: int, *, has_router: bool, in_real_time: bool, ending: str
    ) -> None:
        """Start the world with up to four runners."""
        ends = [*sorted(cuts), ROBOTS]
        robots = tuple(end - first for first, end in zip([0, *ends], ends, strict=False))
        late = 0 if on_loss == "wait" else min(late, len(cuts))
        options = ["--realtime", f"{SPEED:g}"] if in_real_time else []
        options += ["--start-with", str(sum(robots[: len(robots) - late]))] if late else []
        self.start(Kind("world", robots, late=late, has_router=has_router), on_loss, ending, options)

    @rule(trouble=st.sampled_from(list(RUNNER_TROUBLES)), draws=DRAWS)
    def disturb_runner(self, trouble: str, draws: Random) -> None:
        """Kill, freeze or slow a runner or its agent, or let it leave and come back."""
        self.begin(self.troubles.named(trouble, draws))

    @precondition(lambda self: self.site.router is not None)
    @rule(trouble=st.sampled_from(["router_killed", "router_frozen"]), draws=DRAWS)
    def disturb_router(self, trouble: str, draws: Random) -> None:
        """Kill or freeze the router."""
        self.begin(self.troubles.named(trouble, draws))

    @precondition(lambda self: any(not runner.starts for runner in self.site.runners))
    @rule()
    def late_runner_joins(self) -> None:
        """Start a runner that was late."""
        next(runner for runner in self.site.runners if not runner.starts).come()
        self.wait(0.1)


class StartedRunners(DisturbedRun):
    """Agent processes that the run starts, and that do not come back."""

    @initialize(
        on_loss=st.sampled_from(["stop", "dead", "stand", "coast"]),
        runners=st.integers(2, 4),
        ending=st.sampled_from(list(ENDINGS)),
    )
    def start_run(self, on_loss: str, runners: int, ending: str) -> None:
        """Start the run with its runners."""
        robots = (ROBOTS - runners + 1, *[1] * (runners - 1))
        self.start(Kind("run", robots, starts_runners=True), on_loss, ending)

    @precondition(lambda self: self.site.disturbed)
    @rule(
        trouble=st.sampled_from(["runner_killed", "runner_leaves", "runner_frozen", "runner_frozen_too_long"]),
        draws=DRAWS,
    )
    def disturb_runner(self, trouble: str, draws: Random) -> None:
        """Kill, end or freeze an agent process."""
        self.begin(self.troubles.named(trouble, draws))


LIMIT_S = 240.0
SEEDS, LOSSES = 6, [0.0, 0.5]
LONG = "duration_s=20"
KILLS = ("worker", "SIGKILL", "SIGINT", "SIGTERM")


class KilledCampaign(RuleBasedStateMachine):
    """A campaign, or a worker of it, that is killed and resumed."""

    @initialize()
    def make_scenario(self) -> None:
        """Write the scenario."""
        self.folder = new_folder()
        self.temporary = self.folder.absolute() / "tmp"
        self._env = {**environment(self.temporary), "PYTHONFAULTHANDLER": "1"}
        self._scenario, self._campaign = scenario_in(self.folder), self.folder / "campaign"

    @rule(after_s=st.sampled_from((2.0, 4.0, 1.0, 7.0)), victim=st.sampled_from(KILLS))
    def kill(self, after_s: float, victim: str) -> None:
        """Start or resume the campaign, and kill it or a worker; without a worker it goes on."""
        process = self._started()
        try:
            process.ended_within(after_s)
            workers = family(process.pid) if victim == "worker" and process.pid else []
            if workers:
                workers[-1].kill()
            elif victim != "worker":
                process.send(signal.Signals[victim])
            self._await_end(process)
        finally:
            process.kill()
            process.end()

    def teardown(self) -> None:
        """Resume the campaign to its end: it has each run once, as one that was left alone."""
        if not hasattr(self, "folder") or sys.exc_info()[0] is not None:
            return
        process = self._started()
        try:
            self._await_end(process)
        finally:
            process.kill()
            code = process.end()
        log_text = (self.folder / "sweep.log").read_text(errors="replace")
        assert code == 0, f"the last resume ended with {code}: {log_text[-600:]}"
        rows, series = undisturbed_campaign()
        assert rows_in(self._campaign) == rows
        assert series_in(self._campaign).equals(series, null_equal=True)
        invariants.check_no_process(self.temporary)
        invariants.check_no_file(self.temporary)
        shutil.rmtree(self.folder)

    def _started(self) -> Supervised:
        arguments = (str(self._scenario), "--vary", "radio.loss=0,0.5", "--seeds", str(SEEDS), "--set", LONG, "--batch",
                     "2", "--out", str(self._campaign))  # fmt: skip
        if not (self._campaign / "campaign.json").exists():
            shutil.rmtree(self._campaign, ignore_errors=True)  # of a sweep that was killed before its first run
        else:
            arguments = ("--resume", str(self._campaign), "--retry-failed")
        command = (*PYTHON, "swarmwire.deploy", "sweep", *arguments, "--workers", "2", "--quiet")
        process = Supervised("sweep", lambda: command, self.folder / "sweep.log", self._env)
        process.tend(0)
        return process

    def _await_end(self, process: Supervised) -> None:
        """Return when it and its workers have ended; a log of its stacks tells why it takes too long."""
        try:
            assert process.ended_within(LIMIT_S)
            until(lambda: not processes_with(self.temporary))
        except AssertionError:
            process.send(signal.SIGABRT)
            process.end()
            raise Broken((self.folder / "sweep.log").read_text(errors="replace")[-6000:]) from None


@cache
def undisturbed_campaign() -> tuple[list[dict[str, Any]], Any]:
    """Rows and series of the campaign without faults."""
    with tempfile.TemporaryDirectory(prefix="schedule-") as folder:
        sweep(scenario_in(Path(folder)), out=Path(folder, "campaign"), seeds=SEEDS, vary={"radio.loss": LOSSES},
              overrides=[LONG], batch=2, workers=1)  # fmt: skip
        rows = rows_in(Path(folder, "campaign"))
        assert Counter(row["run"] for row in rows) == Counter(range(SEEDS * len(LOSSES)))
        return rows, series_in(Path(folder, "campaign"))
