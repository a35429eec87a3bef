"""Schedules of a run that starts its own runners, as `swarmwire run --runners` does."""

import signal
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from swarmwire.comms.errors import RunnerLost
from swarmwire.deploy.config import Recording
from swarmwire.deploy.simulation import Simulation, finished
from tests.tools.soak import invariants
from tests.tools.soak.agenda import Steps
from tests.tools.soak.place import SCENARIO
from tests.tools.soak.schedules.actors import Actors
from tests.tools.soak.schedules.joined import nothing_left, overrides, own_temporary
from tests.tools.soak.schedules.plan import ROBOTS, Fault, Plan


@dataclass
class Own:
    """A runner that the run has started."""

    process: psutil.Process

    def send(self, number: signal.Signals) -> None:
        """Send it a signal; nobody minds if it is gone."""
        try:
            self.process.send_signal(number)
        except psutil.NoSuchProcess:
            return


class Nursed(Actors):
    """Runners that are the run's own, and observers. Who is dead stays so: nobody starts another."""

    def _tend(self, now_ns: int) -> None:
        if self.tick >= 0:
            for one in self.observers.values():
                one.tend(now_ns)

    def _steps(self, fault: Fault) -> Steps:
        if fault.who in self.observers:
            yield from super()._steps(fault)
            return
        own = self._own()
        at = int(fault.who.removeprefix("r"))
        if at >= len(own):
            return
        if fault.what in ("killed", "leaves"):
            own[at].send(signal.SIGKILL if fault.what == "killed" else signal.SIGTERM)
            return
        own[at].send(signal.SIGSTOP)
        yield fault.for_s
        own[at].send(signal.SIGCONT)

    def _own(self) -> list[Own]:
        found: list[Own] = []
        for one in psutil.Process().children():
            with suppress(psutil.Error):  # an agent host whose runners are all dead has ended
                if "swarmwire.agent.agent_host" in one.cmdline():
                    found += [Own(child) for child in sorted(one.children(), key=lambda child: child.pid)]
        return found


def play_own_runners(plan: Plan, folder: Path) -> list[str]:
    """What held; Broken if something did not."""
    with own_temporary(folder / "tmp") as env:
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
        for own in actors.runners.values():
            own.stay_away()
        actors.start()
        failed = ""
        try:
            finished(simulation)
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
            invariants.fates_add_up(summary),
            "no owners" if failed else invariants.owners_are_known(summary, robots, own=True),
            invariants.folder_is_whole(run),
            invariants.repeats(run) if summary["ticks"] else "no tick to repeat",
            *nothing_left(folder),
        ]
