"""What a lockstep tick costs beyond zenoh and the agents: against processes that only answer, in the same minutes.

After every few ticks of the run as many bytes go to 200 processes that answer at once, with as many bytes, and nothing
else: the floor. Agents tell how much processor time their steps took; on so many cores the sum of it is added to the
floor.
"""

# zenoh's stubs leave out the return type of put.
# pyright: reportUnknownMemberType=false

import os
import queue
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import zenoh

from benchmarks import scenes
from benchmarks.echoes import RUN
from benchmarks.lines import report
from swarmwire.comms.clock import WallClock
from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth
from swarmwire.comms.wire import frames, tick_frames
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import close_session, open_world, unix_endpoint
from swarmwire.deploy import run
from swarmwire.world.scenario_file import scenario_from

AGENT = "benchmarks.agents:TimedBoid"
EVERY, WARM = 10, 20  # ticks
CLOCK = WallClock()


class Floor:
    """Processes that only answer, and a world's session that asks them."""

    def __init__(self, session: zenoh.Session, names: list[str], sent_bytes: int) -> None:
        keys = Keys(RUN)
        self._inbox: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        self._subscriber = session.declare_subscriber(keys.any_answer, (self._inbox.put, self._inbox))
        self._frames = [
            session.declare_publisher(keys.frame(name), congestion_control=zenoh.CongestionControl.BLOCK, express=True)
            for name in names
        ]
        self._data = bytes(sent_bytes)

    def tick_s(self) -> float:
        """How long it takes to ask them all and to have all answers."""
        start_s = CLOCK.now_ns() * 1e-9
        for publisher in self._frames:
            publisher.put(self._data)
        for _ in self._frames:
            self._inbox.get(timeout=60.0).payload.to_bytes()
        return CLOCK.now_ns() * 1e-9 - start_s


class Stopwatch(Observer):
    """Observer that times ticks, and between some of them the floor."""

    def __init__(self, floor: Floor) -> None:
        self._floor = floor
        self._since_s = 0.0
        self.tick_s, self.floor_s, self.agents_s = list[float](), list[float](), list[float]()

    def see(self, truth: Truth) -> None:
        """The end of a tick."""
        now_s = CLOCK.now_ns() * 1e-9
        if truth.tick >= WARM and truth.value is not None:
            self.tick_s.append(now_s - self._since_s)
            self.agents_s.append(float(truth.value.sum()))
        if truth.tick % EVERY == EVERY - 1:
            self._floor.tick_s()  # the first after a while finds its processes cold
            self.floor_s += [self._floor.tick_s() for _ in range(3)]
        self._since_s = CLOCK.now_ns() * 1e-9


def wire_over_floor(name: str, repeats: int, *, robots: int, ticks: int) -> None:
    """A tick over the floor plus the agents' own time."""
    scenario = scenario_from(scenes.flocking(robots, ticks / 10, AGENT), name)
    sent_bytes, answer_bytes = _sizes(lambda: run(scenario.model_copy(update={"duration_s": 2.0}), runners=robots))
    with _echoes([f"e{at}" for at in range(robots)], sent_bytes, answer_bytes) as floor:
        watch = Stopwatch(floor)
        result = run(scenario, runners=robots, observers=[watch])
    tick_s, floor_s = statistics.median(watch.tick_s), statistics.median(watch.floor_s)
    cores = os.cpu_count() or 1
    agents_s = statistics.median(watch.agents_s) / cores
    config = {
        "agent": AGENT,
        "tick_ms": round(tick_s * 1e3, 1),
        "floor_ms": round(floor_s * 1e3, 1),
        "agents_ms": round(agents_s * 1e3, 1),
        "cores": cores,
        "frame_bytes": sent_bytes,
        "answer_bytes": answer_bytes,
    }
    report(name, tick_s / (floor_s + agents_s), "x floor and agents", result, config)


def _sizes(run_some: Callable[[], object]) -> tuple[int, int]:
    """Bytes of the middle frame of a run and of the middle answer."""
    sent, answers = list[int](), list[int]()
    encode, decode = tick_frames.encode_tick, frames.decode

    def encoded(*given: Any) -> bytes:
        data = encode(*given)
        sent.append(len(data))
        return data

    def decoded(data: bytes) -> frames.Frame:
        answers.append(len(data))
        return decode(data)

    with patch("swarmwire.world.backends.lockstep.encode_tick", encoded), patch.object(frames, "decode", decoded):
        run_some()
    return int(statistics.median(sent)), int(statistics.median(answers))


@contextmanager
def _echoes(names: list[str], sent_bytes: int, answer_bytes: int) -> Generator[Floor]:
    with tempfile.TemporaryDirectory(prefix="sw-") as folder:
        endpoint = unix_endpoint(f"{folder}/floor")
        session = open_world(endpoint, runner_timeout_s=60.0)
        alive: queue.SimpleQueue[zenoh.Sample] = queue.SimpleQueue()
        tokens = session.liveliness().declare_subscriber(Keys(RUN).any_alive, (alive.put, alive), history=True)
        command = [sys.executable, "-m", "benchmarks.echoes", endpoint, str(answer_bytes), *names]
        with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
            try:
                for _ in names:
                    alive.get(timeout=60.0)
                yield Floor(session, names, sent_bytes)
            finally:
                if process.stdin is not None:
                    process.stdin.close()
                process.wait()
                del tokens
                close_session(session)
