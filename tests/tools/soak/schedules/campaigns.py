"""Schedules of a campaign whose workers are killed, or that is killed itself and gone on with, again and again."""

import os
import signal
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import psutil

from swarmwire.deploy import sweep
from tests.support.clocks import until
from tests.support.deploy.campaign import rows_in, scenario_in, series_in
from tests.tools.soak.invariants import Broken
from tests.tools.soak.schedules.joined import nothing_left, own_temporary
from tests.tools.soak.schedules.plan import Plan
from tests.tools.soak.supervised import PYTHON, Supervised, family

SEEDS, LOSSES = 6, [0.0, 0.5]
LONG = "duration_s=20"
MAX_KILLS = 3
LIMIT_S = 240.0
STACKS_S = 10.0  # for a process that is aborted to write where it stood


def play_campaign(plan: Plan, folder: Path) -> list[str]:
    """What held; Broken if something did not."""
    rng = np.random.default_rng([plan.seed, 14])
    with own_temporary(folder / "tmp") as env:
        scenario, campaign = scenario_in(folder), folder / "campaign"
        asked = (str(scenario), "--vary", "radio.loss=0,0.5", "--seeds", str(SEEDS), "--set", LONG, "--batch", "2",
                 "--out", str(campaign))  # fmt: skip
        told: list[str] = []

        def start(arguments: Sequence[str]) -> Supervised:
            command = (*PYTHON, "swarmwire.deploy", "sweep", *arguments, "--workers", "2", "--quiet")
            made = Supervised("sweep", lambda: command, folder / "sweep.log", {**env, "PYTHONFAULTHANDLER": "1"})
            made.tend(0)
            return made

        def resumed() -> Sequence[str]:
            return ("--resume", str(campaign), "--retry-failed") if (campaign / "campaign.json").exists() else asked

        for _ in range(int(rng.integers(1, MAX_KILLS + 1))):
            one = start(resumed())
            try:
                threading.Event().wait(float(rng.uniform(0.5, 7.0)))
                told.append(_break(one, rng))
                _await_end(one, folder / "sweep.log")
                until(lambda: not [child for child in family(os.getpid()) if child.status() != "zombie"])
            finally:
                one.kill()
                one.end()
        last = start(resumed())
        try:
            _await_end(last, folder / "sweep.log")
        finally:
            last.kill()
            code = last.end()
        if code != 0:
            raise Broken(f"the last resume ended with {code}: {(folder / 'sweep.log').read_text()[-600:]}")
        return [", ".join(told), each_run_once(campaign, scenario, folder / "whole"), *nothing_left(folder)]


def each_run_once(campaign: Path, scenario: Path, whole: Path) -> str:
    """The campaign's tables have each run exactly once, as those of one that was left alone."""
    sweep(scenario, out=whole, seeds=SEEDS, vary={"radio.loss": LOSSES}, overrides=[LONG], batch=2, workers=1)
    got, expected = rows_in(campaign), rows_in(whole)
    numbers = [row["run"] for row in got]
    if sorted(numbers) != list(range(SEEDS * len(LOSSES))):
        raise Broken(f"the table has the runs {sorted(numbers)}")
    if got != expected:
        raise Broken("rows differ from those of a campaign that was left alone")
    if not series_in(campaign).equals(series_in(whole), null_equal=True):
        raise Broken("series differ from those of a campaign that was left alone")
    return f"{len(numbers)} runs, each once, the same as without faults"


def _await_end(one: Supervised, log: Path) -> None:
    """Return when it has ended; Broken, with where each of its threads stood, if it takes too long."""
    if one.ended_within(LIMIT_S):
        return
    if one.pid is not None:
        for process in family(one.pid):
            with suppress(psutil.NoSuchProcess):  # some end at this very moment
                process.send_signal(signal.SIGABRT)
    one.send(signal.SIGABRT)
    one.ended_within(STACKS_S)
    raise Broken(f"the campaign did not end within {LIMIT_S:g} s: {log.read_text(errors='replace')[-6000:]}")


def _break(one: Supervised, rng: np.random.Generator) -> str:
    if rng.random() < 0.5 and one.pid is not None:
        workers = family(one.pid)
        if workers:
            workers[int(rng.integers(len(workers)))].kill()
            return "worker killed"
    number = (signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM)[int(rng.integers(4))]
    one.send(number)
    return f"campaign {number.name}"
