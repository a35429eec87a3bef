"""The soak: a world in lockstep and a world in real time, whose processes are disturbed all the time.

Results are written at once: `samples.csv`, `troubles.jsonl`, and `counts.json` at the end.
"""

import json
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from random import Random  # noqa: TID251 - Hypothesis draws troubles by the same interface
from typing import Any

from swarmwire.comms.base.clock import to_ns, to_s
from swarmwire.comms.base.errors import SwarmwireError
from tests.tools.soak.processes import environment
from tests.tools.soak.samples import take_samples
from tests.tools.soak.site import Course, Kind, Site
from tests.tools.soak.troubles import Troubles

LOCKSTEP = "lockstep"
TIMEOUT_S = 8.0  # timeout of a runner, equal to soak.toml
SAMPLE_S = 10.0
GAP_S = 5.0  # between two troubles of a world, on average
CALM_S = 30.0  # before the end, in which no trouble begins
COME_S = 600.0  # time for all runners to join
PROCESSES_EACH = 10  # agent processes of an agent host of the world in lockstep
UNTOUCHED = 2  # runners, the first, of which samples are taken
REAL_TIME_SHARE = 5  # an agent process of the world in real time, with a host of its own, for so many in lockstep


def kinds(processes: int) -> list[Kind]:
    """The worlds: troubles change nothing in lockstep; in real time robots coast meanwhile."""
    in_real_time = ("--realtime", "1", "--set", "run.on_runner_loss=coast", "--packets", "0.01", "--no-rrd")
    hosts = max(UNTOUCHED + 1, processes // PROCESSES_EACH)
    alone = max(UNTOUCHED + 1, processes // REAL_TIME_SHARE)
    return [
        Kind(LOCKSTEP, (PROCESSES_EACH,) * hosts, ("--links", "--packets", "0.001"), speed=0.5, untouched=UNTOUCHED),
        Kind("realtime", (1,) * alone, in_real_time, untouched=UNTOUCHED),
    ]


class Hour:
    """A soak of so many minutes.

    Attributes:
        faults: errors of the soak itself.
    """

    def __init__(self, folder: Path, minutes: float, processes: int, seed: int) -> None:
        """`processes` are the agent processes of the world in lockstep; `folder` must not be there yet."""
        folder.mkdir(parents=True)
        self.folder, self._minutes = folder, minutes
        env = environment(folder.absolute() / "tmp")
        self.sites = [Site(kind, folder.absolute() / kind.name, env) for kind in kinds(processes)]
        self.sites[0].observe(["observer-calm", "page-calm", "tab-calm", "observer", "page", "tab"])
        self.sites[1].observe(["observer-calm", "observer"])
        self.troubles = [Troubles(site, partial(self._note, site.kind.name), TIMEOUT_S) for site in self.sites]
        self.faults: list[str] = []
        self._log = (folder / "troubles.jsonl").open("w", buffering=1)
        self._course, self._draws = Course(*self.sites), Random(seed)
        self._started_ns = self._course.now_ns

    def run(self) -> None:
        """Start all, disturb it, and end it."""
        try:
            for site in self.sites:
                self._course.until(lambda site=site: site.live, f"{site.kind.name} to begin", COME_S)
                if (speed := site.kind.speed) is not None:
                    site.ask(lambda run, speed=speed: run.speed(speed))
            self._note("harness", "begun")
            self._started_ns = self._course.now_ns
            self._disturb()
            self._note("harness", "calm")
            self._course.pass_time(CALM_S)
            self._course.recover()
            self._sample()
            self._course.end()
            self._note("harness", "ended")
        except BaseException as error:
            self._note("harness", "failed", repr(error))
            raise
        finally:
            for site in self.sites:
                site.close()
            self._log.close()
            (self.folder / "counts.json").write_text(json.dumps(self.counts(), indent=2) + "\n")

    def counts(self) -> dict[str, Any]:
        """Counts of troubles and of restarts."""
        counts: dict[str, Any] = {"faults of the soak": self.faults}
        for site, troubles in zip(self.sites, self.troubles, strict=True):
            counts[site.kind.name] = {
                "troubles": dict(sorted(troubles.tally.items())),
                "orders not taken": troubles.unanswered,
                "runner processes started": sum(process.starts for process in site.runners),
                "exit codes": site.exit_codes,
                "world": site.world.codes,
            }
        return counts

    def _disturb(self) -> None:
        """Begin troubles and take samples until the end of the time."""
        end_ns = self._started_ns + to_ns(60.0 * self._minutes - CALM_S)
        sample_ns, next_ns = self._started_ns, [self._started_ns + to_ns(GAP_S)] * len(self.sites)
        while (now_ns := self._course.now_ns) < end_ns:
            with self._noted():
                self._course.step()
            for at, troubles in enumerate(self.troubles):
                if now_ns >= next_ns[at]:
                    next_ns[at] = now_ns + to_ns(self._draws.expovariate(1.0 / GAP_S))
                    with self._noted():
                        self._course.begin(troubles.drawn(self._draws))
            if now_ns >= sample_ns:
                sample_ns += to_ns(SAMPLE_S)
                with self._noted():
                    self._sample()

    @contextmanager
    def _noted(self) -> Generator[None]:
        """Note errors instead of ending the soak."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - told in the result, which then does not hold
            self.faults.append(repr(error))
            self._note("harness", "fault", repr(error))

    def _sample(self) -> None:
        for site, troubles in zip(self.sites, self.troubles, strict=True):
            try:
                status = site.ask(lambda run: run.status())
            except SwarmwireError as error:
                self._note(site.kind.name, "unanswered", str(error))
                continue
            if status is not None:
                at_s, events = to_s(self._course.now_ns - self._started_ns), troubles.events
                pids = {f"{site.kind.name} {who}": pid for who, pid in _undisturbed(site).items()}
                take_samples(self.folder / "samples.csv", pids, at_s=at_s, tick=status["tick"],
                             tick_ms=status["measures_ms"] or 0.0, events=events)  # fmt: skip

    def _note(self, site: str, event: str, *more: Any) -> None:
        at_s = round(to_s(self._course.now_ns - self._started_ns), 2)
        self._log.write(json.dumps([at_s, site, event, *more]) + "\n")


def _undisturbed(site: Site) -> dict[str, int | None]:
    """Process ids of the world, and of runners and observers that are never disturbed, by name."""
    pids: dict[str, int | None] = {"world": site.world.pid}
    for number, runner in enumerate(site.runners[: site.kind.untouched], start=1):
        pids[f"host {number}"] = runner.pid
        agents = enumerate(site.agents_of(runner), start=1)
        pids |= {f"host {number}, agent {agent}": process.pid for agent, process in agents}
    for name, process in site.observers.items():
        if name.endswith("calm"):
            pids[name.partition("-")[0]] = process.pid
    return pids
