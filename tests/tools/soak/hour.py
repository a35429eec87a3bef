"""The soak: two worlds, one in lockstep and one in real time, to whose processes something happens all the time.

All that is found is written as it is found: `samples.csv`, `troubles.jsonl`, and `result.json` at the end.
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
from tests.tools.soak.place import Kind, Place
from tests.tools.soak.processes import Agenda, environment
from tests.tools.soak.samples import Samples
from tests.tools.soak.troubles import UNTOUCHED, Troubles

TIMEOUT_S = 8.0  # of a runner, as in soak.toml
LOOP_S = 0.05
SAMPLE_S = 10.0
GAP_S = 5.0  # between two troubles of a world, on average
CALM_S = 30.0  # before the end, in which nothing happens and whoever is away comes back
COME_S = 600.0  # for all runners to join at the start
END_S = 120.0  # for all to end
PROCESSES_EACH = 10  # agent processes of an agent host of the world in lockstep
REAL_TIME_SHARE = 5  # an agent process of the world in real time, with a host of its own, for so many in lockstep


def kinds(processes: int) -> list[Kind]:
    """The worlds: in lockstep nothing of what happens may matter; in real time robots coast meanwhile."""
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
        self.places = [Place(kind, folder.absolute() / kind.name, env) for kind in kinds(processes)]
        self._samples = Samples(folder / "samples.csv")
        self._log = (folder / "troubles.jsonl").open("w", buffering=1)
        self.places[0].observe(["observer-calm", "page-calm", "tab-calm", "observer", "page", "tab"])
        self.places[1].observe(["observer-calm", "observer"])
        rngs = np.random.default_rng(seed).spawn(len(self.places))
        self.troubles = [
            Troubles(place, rng, self._teller(place.kind.name), TIMEOUT_S)
            for place, rng in zip(self.places, rngs, strict=True)
        ]
        self._gaps = np.random.default_rng(seed + 1)
        self._agenda = Agenda()
        self.faults: list[str] = []
        self._started_ns = self._clock.now_ns()

    def run(self) -> None:
        """Bring all up, let it go on, and bring it to its end."""
        try:
            self._come()
            self._started_ns = self._clock.now_ns()
            self._go_on()
            self._calm_down()
            self._end()
        except BaseException as error:
            self._tell("harness", "failed", "", repr(error))
            raise
        finally:
            for place in self.places:
                place.close()
            self._log.close()
            (self.folder / "counts.json").write_text(json.dumps(counts_of(self), indent=2) + "\n")

    def _come(self) -> None:
        """Worlds, then runners, then those who look on."""
        for place in self.places:
            place.world.tend(0)
            place.world.stay_away()
            self._until(lambda place=place: place.live is not None, COME_S, f"{place.kind.name} to begin", only=place)
            if place.kind.speed is not None:
                self._ask(place, lambda run, speed=place.kind.speed: run.speed(speed))
            self._tell("harness", "begun", place.kind.name)

    def _go_on(self) -> None:
        """Troubles and samples, until the time is over."""
        end_ns = self._started_ns + to_ns(60.0 * self._minutes - CALM_S)
        sample_ns, next_ns = self._started_ns, [self._started_ns + to_ns(5.0)] * len(self.places)
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
        """What was begun comes to its end; whoever is frozen thaws, and all come back."""
        self._tell("harness", "calm", "")
        until_ns = self._clock.now_ns() + to_ns(CALM_S)
        while (now_ns := self._clock.now_ns()) < until_ns:
            self._clock.sleep_until(now_ns + to_ns(LOOP_S))
            with self._noted():
                self._step(now_ns)
        for place in self.places:
            for one in place.all:
                one.send(signal.SIGCONT)
        for place in self.places:
            self._until(lambda place=place: self._all_play(place), END_S, "all runners to be back")
        self._sample(self._clock.now_ns())

    def _end(self) -> None:
        """The runs are stopped; all of their processes end by themselves, and pages when they are asked to."""
        for place in self.places:
            for one in place.all:
                one.stay_away()
            self._ask(place, lambda run: run.stop())
        for place in self.places:
            world = place.world
            self._until(lambda world=world: world.pid is None, END_S, "the world to end")
            runners = place.runners
            self._until(lambda runners=runners: all(one.pid is None for one in runners), END_S, "runners to end")
            for name, one in place.observers.items():
                if name.startswith("page"):
                    one.send(signal.SIGINT)
            others = list(place.observers.values())
            self._until(lambda others=others: all(one.pid is None for one in others), END_S, "observers to end")
        self._tell("harness", "ended", "")

    def _step(self, now_ns: int) -> None:
        """Whoever ended is started again, and what is due happens."""
        for place in self.places:
            place.tend(now_ns)
        self._agenda.step(now_ns)

    @contextmanager
    def _noted(self) -> Generator[None]:
        """What goes wrong in here is noted, and ends no soak that has gone on for most of an hour."""
        try:
            yield
        except Exception as error:  # noqa: BLE001 - told in the result, which then does not hold
            self.faults.append(repr(error))
            self._tell("harness", "fault", "", repr(error))

    def _until(self, holds: Callable[[], bool], for_s: float, what: str, only: Place | None = None) -> None:
        until_ns = self._clock.now_ns() + to_ns(for_s)
        while not holds():
            now_ns = self._clock.now_ns()
            if now_ns > until_ns:
                raise TimeoutError(f"waited {for_s:g} s for {what}")
            for place in [only] if only else self.places:
                place.tend(now_ns)
                place.world.tend(now_ns)
            self._clock.sleep_until(now_ns + to_ns(LOOP_S))

    def _sample(self, now_ns: int) -> None:
        for place, troubles in zip(self.places, self.troubles, strict=True):
            if place.world.frozen:
                continue
            status = self._ask(place, lambda run: run.status())
            if status is None:
                continue
            whose = place.kind.name
            pids: dict[str, int | None] = {"world": place.world.pid}
            for number, runner in enumerate(place.runners[:UNTOUCHED], start=1):
                pids[f"host {number}"] = runner.pid
                agents = enumerate(place.agents_of(runner), start=1)
                pids |= {f"host {number}, agent {agent}": process.pid for agent, process in agents}
            for name, one in place.observers.items():
                if name.endswith("calm"):
                    pids[name.partition("-")[0]] = one.pid
            if "page-calm" in place.observers:
                pids["viewer"] = next(iter(place.viewers_of("page-calm")), None)
            named = {f"{whose} {who}": pid for who, pid in pids.items()}
            at_s = to_s(now_ns - self._started_ns)
            self._samples.take(at_s, named, status["tick"], status["measures_ms"] or 0.0, troubles.events)

    def _all_play(self, place: Place) -> bool:
        status = self._ask(place, lambda run: run.status())
        return status is not None and status["runners"]["robots_free"] == 0

    def _ask(self, place: Place, ask: Callable[[Any], Any]) -> Any:
        live = place.live
        if live is None:
            return None
        try:
            with controlling(live.endpoint, live.run) as run:
                return ask(run)
        except SwarmwireError as error:
            self._tell(place.kind.name, "unanswered", "harness", str(error))
            return None

    def _teller(self, place: str) -> Callable[..., None]:
        return lambda what, who, *more: self._tell(place, what, who, *more)

    def _tell(self, place: str, what: str, who: str, *more: Any) -> None:
        at_s = round(to_s(self._clock.now_ns() - self._started_ns), 2)
        self._log.write(json.dumps([at_s, place, what, who, *more]) + "\n")


def counts_of(hour: Hour) -> Mapping[str, Any]:
    """How often each trouble happened, and how often processes were started again."""
    return {
        "faults of the soak": hour.faults,
    } | {
        place.kind.name: {
            "troubles": dict(sorted(troubles.told.items())),
            "orders not taken": troubles.unanswered,
            "runner processes started": sum(one.starts for one in place.runners),
            "exit codes": {
                "runners": _tallied([code for one in place.runners for code in one.codes]),
                **{name: _tallied(one.codes) for name, one in place.observers.items()},
            },
            "world": place.world.codes,
        }
        for place, troubles in zip(hour.places, hour.troubles, strict=True)
    }


def _tallied(codes: list[int]) -> Mapping[str, int]:
    return {str(code): codes.count(code) for code in sorted(set(codes))}
