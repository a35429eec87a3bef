"""Schedules of a run with runners of its own that is ended by a signal at any moment, perhaps while it is frozen."""

import os
import signal
import threading
from pathlib import Path

import numpy as np

from swarmwire.deploy import repeat
from swarmwire.metrics.run_folder.layout import DIGESTS
from swarmwire.metrics.run_folder.table import State
from swarmwire.metrics.run_folder.verify import verify
from tests.support.clocks import until
from tests.tools.soak import invariants
from tests.tools.soak.invariants import Broken
from tests.tools.soak.place import SCENARIO
from tests.tools.soak.schedules.joined import nothing_left, overrides, own_temporary
from tests.tools.soak.schedules.plan import Plan
from tests.tools.soak.supervised import PYTHON, Supervised, family

SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
ENDS = {signal.SIGKILL: -9, signal.SIGTERM: 130, signal.SIGINT: 130, signal.SIGHUP: 129}
BEGIN_S, END_S = 240.0, 120.0  # on a machine that is busy
EACH_S = 0.02


def play_killed_world(plan: Plan, folder: Path) -> list[str]:
    """What held; Broken if something did not."""
    rng = np.random.default_rng([plan.seed, 13])
    number, after_s = SIGNALS[int(rng.integers(len(SIGNALS)))], float(rng.uniform(0.0, 3.0))
    with own_temporary(folder / "tmp") as env:
        sets = [word for one in overrides(plan) for word in ("--set", one)]
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
                raise Broken(f"the world did not end within {END_S:g} s of {number.name}")
            until(lambda: not [one for one in family(os.getpid()) if one.is_running() and one.status() != "zombie"])
        finally:
            world.kill()
            code = world.end()
        if code != ENDS[number]:
            raise Broken(f"{number.name}: exit code {code}; {(folder / 'world.log').read_text()[-600:]}")
        return [
            f"{number.name} after {after_s:.1f} s",
            *_left_behind(folder, number),
            *nothing_left(folder, killed=number == signal.SIGKILL),
        ]


def _begun(digests: Path, world: Supervised) -> None:
    """Return once the run has ticked."""
    for _ in range(int(BEGIN_S / EACH_S)):
        if digests.exists():
            return
        if world.pid is None:
            break
        threading.Event().wait(EACH_S)
    raise Broken("the run did not begin")


def _left_behind(folder: Path, number: signal.Signals) -> list[str]:
    run = folder / "run"
    if number != signal.SIGKILL:
        summary = invariants.read_summary(run)
        if summary["ended"] != "interrupted":
            raise Broken(f"it ended as {summary['ended']}")
        return [invariants.fates_add_up(summary), invariants.folder_is_whole(run), invariants.repeats(run)]
    bad = [one for one in verify(run) if one.state in (State.DAMAGED, State.DIFFERS)]
    if bad:
        raise Broken("; ".join(f"{one.part}: {one.state}, {one.text}" for one in bad))
    for path in (folder / "tmp" / "own" / "swarmwire").glob("*.json"):
        path.unlink()  # whoever looks for runs next does that
    again = repeat(run)
    if again.same is False:
        raise Broken(f"repeat differs from tick {again.first_difference} on")
    return ["what is left of the folder can be read", f"repeated {again.compared} ticks, the same"]
