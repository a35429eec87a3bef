"""A lockstep tick beside its floor: as many processes that only answer, in the same minutes, and the agents' time.

After every few ticks of the run as many bytes go to as many processes, over socket pairs, and come back: the floor.
Agents report how much processor time their steps took; the sum of it, shared by the cores, is added to the floor.
"""

import os
import statistics
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager

from benchmarks import scenes
from benchmarks.lines import report
from swarmwire.agent import process_frames
from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import run
from swarmwire.world.scenario_file import scenario_from

AGENT = "benchmarks.agents:TimedBoid"
EVERY, WARM = 10, 20  # ticks
READINGS, MEASURES, PAYLOAD_BYTES, PACKETS = 9, 2, 6, 10  # of a robot: rays and heading; range and bearing
CLOCK = WallClock()


class Floor:
    """The processes that only answer."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        assert process.stdin
        assert process.stdout
        self._stdin, self._stdout = process.stdin, process.stdout

    def tick_s(self) -> float:
        """How long it takes to send each a frame and to have all answers."""
        self._stdin.write("\n")
        self._stdin.flush()
        return int(self._stdout.readline()) * 1e-9


class Stopwatch(Observer):
    """Observer that times ticks, and between some of them the floor."""

    def __init__(self, floor: Floor) -> None:
        self._floor = floor
        self._since_s = 0.0
        self.tick_s, self.floor_s, self.agents_s = list[float](), list[float](), list[float]()

    def see(self, truth: Truth) -> None:
        """The end of a tick."""
        now_s = CLOCK.now_ns() * 1e-9
        if truth.tick >= WARM and truth.tick % EVERY and truth.value is not None:  # the first after a floor is cold
            self.tick_s.append(now_s - self._since_s)
            self.agents_s.append(float(truth.value.sum()))
        if truth.tick % EVERY == EVERY - 1:
            self._floor.tick_s()  # so is the first of the floor
            self.floor_s += [self._floor.tick_s() for _ in range(3)]
        self._since_s = CLOCK.now_ns() * 1e-9


def wire_over_floor(name: str, repeats: int, *, robots: int, ticks: int) -> None:
    """A tick over the floor plus the agents' own time."""
    scenario = scenario_from(scenes.flocking(robots, ticks / 10, AGENT), name)
    run(scenario.model_copy(update={"duration_s": 1.0}))  # kernels
    sent_bytes, answer_bytes = _sizes()
    with _floor(robots, sent_bytes, answer_bytes) as floor:
        watch = Stopwatch(floor)
        result = run(scenario, runners="per-robot", observers=[watch])
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


def _sizes() -> tuple[int, int]:
    """Bytes of the frame to a process that receives ten packets, and of its answer with one."""
    packet = process_frames.packet_struct(MEASURES).size + PAYLOAD_BYTES
    head = process_frames.HEAD.size + process_frames.COUNT.size + process_frames.ROW.size
    return head + 8 * READINGS + PACKETS * packet, len(process_frames.answer_head(0, 1, 1, PAYLOAD_BYTES)) + 78


@contextmanager
def _floor(processes: int, sent_bytes: int, answer_bytes: int) -> Generator[Floor]:
    command = [sys.executable, "-m", "benchmarks.floor", *map(str, (processes, sent_bytes, answer_bytes))]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield Floor(process)
        if process.stdin:
            process.stdin.close()
