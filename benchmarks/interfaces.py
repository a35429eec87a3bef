"""Programs' frames over the radio: how late they are delivered, what they cost, and how long robots take to start."""

import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.lines import report, spread
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import Result, run
from swarmwire.world.scenario.scenario import Scenario
from swarmwire.world.scenario_file import load_scenario

FRAMES_HZ, FRAME_BYTES = 50, 200
HEADERS_BYTES = 42  # Ethernet, IPv4, UDP
# Each robot sends to the next one; a bound socket, whose buffer holds unread datagrams, answers nothing.
SENDER = """
import ipaddress, os, socket, sys, time

robots, hz, size = map(int, sys.argv[1:])
index, own = int(os.environ["ROBOT_INDEX"]), ipaddress.ip_address(os.environ["ROBOT_IPV4"])
to = str(own - index + (index + 1) % robots)
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
out.bind(("0.0.0.0", 9000))
at = time.monotonic() + index / robots / hz
while True:
    time.sleep(max(0.0, at - time.monotonic()))
    out.sendto(bytes(size), (to, 9000))
    at += 1 / hz
"""
STANDING = Path(__file__).parents[1] / "examples" / "interfaces" / "standing.py"
RADIOS: dict[str, dict[str, Any]] = {
    "disk": {"range_m": 30.0, "bit_rate_bps": 54_000_000, "max_payload_bytes": 1514, "queue_limit": 200},
    "wifi": {"preset": "wifi-a-6M"},
}


class Cpu(Observer):
    """The CPU time of this process between the first and the last tick."""

    def __init__(self) -> None:
        self.first_s: float | None = None
        self.last_s = 0.0

    def see(self, truth: Truth) -> None:
        self.last_s = time.process_time()
        if self.first_s is None:
            self.first_s = self.last_s

    @property
    def used_s(self) -> float:
        return self.last_s - (self.first_s or 0.0)


def interfaces(name: str, repeats: int, *, radio: str, robots: int, duration_s: float) -> None:
    """p99 of the lateness of deliveries in ms; CPU per frame beyond that of the same run without interfaces in us."""
    with TemporaryDirectory() as folder:
        scenario = _scenario(Path(folder), radio, robots, duration_s)
        plain = [_measured(_without(scenario)) for _ in range(repeats)]
        measured = [_measured(scenario) for _ in range(repeats)]
    idle_s = statistics.median(used_s for _, used_s in plain)
    late_ms, cpu_us = list[float](), list[float]()
    for result, used_s in measured:
        frames = result.interfaces
        assert frames is not None
        assert frames.delivery is not None
        late_ms.append(1e3 * frames.delivery.p99_s)
        cpu_us.append(1e6 * (used_s - idle_s) / frames.sent)
    last = measured[-1][0]
    assert last.interfaces is not None
    assert last.radio is not None
    config: dict[str, Any] = {
        "radio": RADIOS[radio],
        "frames_hz": FRAMES_HZ,
        "frame_bytes": FRAME_BYTES,
        "sent": last.interfaces.sent,
        "delivered": last.interfaces.delivered,
        "fates": {fate: count for fate, count in last.radio.fates.items() if count},
        "counts": last.counts,
    }
    report(name, statistics.median(late_ms), "ms", last, {**config, **spread(late_ms)})
    report(f"{name}-cpu", statistics.median(cpu_us), "us", last, {**config, **spread(cpu_us)})


def interfaces_start(name: str, repeats: int, *, robots: int) -> None:
    """Seconds from the call to the first tick, with an interface and a program on each robot."""
    with TemporaryDirectory() as folder:
        scenario = _scenario(Path(folder), "disk", robots, 0.1)
        results = [_measured(scenario)[0] for _ in range(repeats + 1)][1:]  # the first compiles
    seconds = [result.start_time_s for result in results]
    report(name, statistics.median(seconds), "s", results[-1], spread(seconds))


def _scenario(folder: Path, radio: str, robots: int, duration_s: float) -> Scenario:
    (folder / "sender.py").write_text(SENDER)
    program = [sys.executable, "sender.py", str(robots), str(FRAMES_HZ), str(FRAME_BYTES - HEADERS_BYTES)]
    table = ", ".join(f"{key} = {value!r}" for key, value in RADIOS[radio].items())
    (folder / "scenario.toml").write_text(
        f"""
format = 1
name = "interfaces"
duration_s = {duration_s}
arena = {{ size_m = [8.0, 8.0] }}
radio = {{ {table}, interface = {{}} }}
[robots.flock]
body = "epuck2"
count = {robots}
agent = "{STANDING}:Standing"
program = {program}
"""
    )
    return load_scenario(folder / "scenario.toml", [])


def _without(scenario: Scenario) -> Scenario:
    """The scenario without interfaces and programs."""
    assert scenario.radio is not None
    flock = scenario.robots["flock"].model_copy(update={"program": ()})
    update = {"robots": {"flock": flock}, "radio": replace(scenario.radio, interface=None)}
    return scenario.model_copy(update=update)


def _measured(scenario: Scenario) -> tuple[Result, float]:
    cpu = Cpu()
    return run(scenario, realtime=1.0, observers=[cpu]), cpu.used_s
