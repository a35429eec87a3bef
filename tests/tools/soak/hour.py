"""The soak: a world in lockstep and a world in real time, whose processes are disturbed all the time.

Results are written at once: `samples.csv`, `troubles.jsonl`, and `result.json` at the end.
"""

import json
import signal
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.base.clock import WallClock, to_ns, to_s
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.live.remote_control import controlling
from tests.tools.soak.processes import Agenda, environment
from tests.tools.soak.samples import Samples
from tests.tools.soak.site import Kind, Site
from tests.tools.soak.troubles import UNTOUCHED, Troubles

TIMEOUT_S = 8.0  # timeout of a runner, equal to soak.toml
LOOP_S = 0.05
SAMPLE_S = 10.0
GAP_S = 5.0  # between two troubles of a world, on average
CALM_S = 30.0  # before the end, in which nothing happens and whoever is away comes back
COME_S = 600.0  # time for all runners to join
END_S = 120.0  # time for all to end
PROCESSES_EACH = 10  # agent processes of an agent host of the world in lockstep
REAL_TIME_SHARE = 5  # an agent process of the world in real time, with a host of its own, for so many in lockstep


def kinds(processes: int) -> list[Kind]:
    """The worlds: troubles change nothing in lockstep; in real time robots coast meanwhile."""
    in_real_time = ("--realtime", "1", "--set", "run.on_runner_loss=coast", "--packets", "0.01", "--no-rrd")
    return [
        Kind("lockstep", processes, PROCESSES_EACH, ("--links", "--packets", "0.001"), speed=0.5),
        Kind("realtime", max(4, processes // REAL_TIME_SHARE), 1, in_real_time),
    ]


class Hour:
    """A soak of so many minutes.

    Attributes:
        places: its worlds.
        temporary: where its processes have their temporary files.
        faults: errors of the soak itself.
    """

    def __init__(self, folder: Path, minutes: float, processes: int, seed: int) -> None:
        """`processes` are the agent processes of the world in lockstep; `folder` must not be there yet."""
        folder.mkdir(parents=True)
        self.folder, self._minutes, self._clock = folder, minutes, WallClock()
        self.temporary = folder.absolute() / "tmp"
        env = environment(self.temporary)
        self.sites = [Site(kind, folder.absolute() / kind.name, env) for kind in kinds(processes)]
        self._samples = Samples(folder / "samples.csv")
        self._log = (folder / "troubles.jsonl").open("w", buffering=1)
        self.sites[0].observe(["observer-calm", "page-calm", "tab-calm", "observer", "page", "tab"])
        self.sites[1].observe(["observer-calm", "observer"])
        rngs = np.random.default_rng(seed).spawn(len(self.sites))
        self.troubles = [
            Troubles(site, rng, self._teller(site.kind.name), TIMEOUT_S)
            for site, rng in zip(self.sites, rngs, strict=True)
        ]
        self._gaps = np.random.default_rng(seed + 1)
        self._agenda = Agenda()
        self.faults: list[str] = []
        self._started_ns = self._clock.now_ns()

    def run(self) -> None:
        """Start all, disturb it, and end it."""
        try:
            self._start_all()
            self._started_ns = self._clock.now_ns()
            self._run_troubles()
            self._calm_down()
            self._end()
        except BaseException as error:
            self._note("harness", "failed", "", repr(error))
            raise
        finally:
            for site in self.sites:
                site.close()
            self._log.close()
            (self.folder / "counts.json").write_text(json.dumps(counts_of(self), indent=2) + "\n")

    def _start_all(self) -> None:
        """Start worlds, runners, then observers."""
        for site in self.sites:
            site.world.tend(0)
            site.world.stay_away()
            self._until(lambda site=site: site.live is not None, COME_S, f"{site.kind.name} to begin", only=site)
            if site.kind.speed is not None:
                self._ask(site, lambda run, speed=site.kind.speed: run.speed(speed))
            self._note("harness", "begun", site.kind.name)

    def _run_troubles(self) -> None:
        """Run troubles and take samples until the end of the time."""
        end_ns = self._started_ns + to_ns(60.0 * self._minutes - CALM_S)
        sample_ns, next_ns = self._started_ns, [self._started_ns + to_ns(5.0)] * len(self.sites)
        while (now_ns := self._clock.now_ns()) < end_ns:
            self._clock.sleep_until(now_ns + to_ns(LOOP_S))
            with self._noted():
                self._step(now_ns)
            for at, troubles in enumerate(self.troubles):
                if now_ns >= next_ns[at]:
                    next_ns[at] = now_ns + to_ns(float(self._gaps.exponential(GAP_S)))
                    with self._noted():
                        self._agenda.begin(troubles.next(), now_ns)
            if now_ns >= sample_ns:
                sample_ns += to_ns(SAMPLE_S)
                with self._noted():
                    self._sample(now_ns)

    def _calm_down(self) -> None:
        """Finish all troubles, thaw and restart all processes."""
        self._note("harness", "calm", "")
        until_ns = self._clock.now_ns() + to_ns(CALM_S)
        while (now_ns := self._clock.now_ns()) < until_ns:
            self._clock.sleep_until(now_ns + to_ns(LOOP_S))
            with self._noted():
                self._step(now_ns)
        for site in self.sites:
            for process in site.all:
                process.send(signal.SIGCONT)
        for site in self.sites:
            self._until(lambda site=site: self._all_play(site), END_S, "all runners to be back")
        self._sample(self._clock.now_ns())

    def _end(self) -> None:
        """Stop the runs, and wait for the end of all processes; pages end at SIGINT."""
        for site in self.sites:
            for process in site.all:
                process.stay_away()
            self._ask(site, lambda run: run.stop())
        for site in self.sites:
            world = site.world
            self._until(lambda world=world: world.pid is None, END_S, "the world to end")
            runners = site.runners
            self._until(
                lambda runners=runners: all(process.pid is None for process in runners), END_S, "runners to end"
            )
            for name, process in site.observers.items():
                if name.startswith("page"):
                    process.send(signal.SIGINT)
            others = list(site.observers.values())
            self._until(lambda others=others: all(process.pid is None for process in others), END_S, "observers to end")
        self._note("harness", "ended", "")

    def _step(self, now_ns: int) -> None:
        """Restart ended processes, and run due steps."""
        for site in self.sites:
            site.tend(now_ns)
        self._agenda.step(now_ns)

    @contextmanager
    def _noted(self) -> Generator[None]:
        """Note errors instead of ending the soak."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - told in the result, which then does not hold
            self.faults.append(repr(error))
            self._note("harness", "fault", "", repr(error))

    def _until(self, holds: Callable[[], bool], for_s: float, event: str, only: Site | None = None) -> None:
        until_ns = self._clock.now_ns() + to_ns(for_s)
        while not holds():
            now_ns = self._clock.now_ns()
            if now_ns > until_ns:
                raise TimeoutError(f"waited {for_s:g} s for {event}")
            for site in [only] if only else self.sites:
                site.tend(now_ns)
                site.world.tend(now_ns)
            self._clock.sleep_until(now_ns + to_ns(LOOP_S))

    def _sample(self, now_ns: int) -> None:
        for site, troubles in zip(self.sites, self.troubles, strict=True):
            if site.world.frozen:
                continue
            status = self._ask(site, lambda run: run.status())
            if status is None:
                continue
            whose = site.kind.name
            pids: dict[str, int | None] = {"world": site.world.pid}
            for number, runner in enumerate(site.runners[:UNTOUCHED], start=1):
                pids[f"host {number}"] = runner.pid
                agents = enumerate(site.agents_of(runner), start=1)
                pids |= {f"host {number}, agent {agent}": process.pid for agent, process in agents}
            for name, process in site.observers.items():
                if name.endswith("calm"):
                    pids[name.partition("-")[0]] = process.pid
            if "page-calm" in site.observers:
                pids["viewer"] = next(iter(site.viewers_of("page-calm")), None)
            named = {f"{whose} {who}": pid for who, pid in pids.items()}
            at_s = to_s(now_ns - self._started_ns)
            self._samples.take(at_s, named, status["tick"], status["measures_ms"] or 0.0, troubles.events)

    def _all_play(self, site: Site) -> bool:
        status = self._ask(site, lambda run: run.status())
        return status is not None and status["runners"]["robots_free"] == 0

    def _ask(self, site: Site, ask: Callable[[Any], Any]) -> Any:
        live = site.live
        if live is None:
            return None
        try:
            with controlling(live.endpoint, live.run) as run:
                return ask(run)
        except SwarmwireError as error:
            self._note(site.kind.name, "unanswered", "harness", str(error))
            return None

    def _teller(self, site: str) -> Callable[..., None]:
        return lambda event, who, *more: self._note(site, event, who, *more)

    def _note(self, site: str, event: str, who: str, *more: Any) -> None:
        at_s = round(to_s(self._clock.now_ns() - self._started_ns), 2)
        self._log.write(json.dumps([at_s, site, event, who, *more]) + "\n")


def counts_of(hour: Hour) -> Mapping[str, Any]:
    """Counts of troubles and of restarts."""
    return {
        "faults of the soak": hour.faults,
    } | {
        site.kind.name: {
            "troubles": dict(sorted(troubles.tally.items())),
            "orders not taken": troubles.unanswered,
            "runner processes started": sum(process.starts for process in site.runners),
            "exit codes": {
                "runners": _tallied([code for process in site.runners for code in process.codes]),
                **{name: _tallied(process.codes) for name, process in site.observers.items()},
            },
            "world": site.world.codes,
        }
        for site, troubles in zip(hour.sites, hour.troubles, strict=True)
    }


def _tallied(codes: list[int]) -> Mapping[str, int]:
    return {str(code): codes.count(code) for code in sorted(set(codes))}
