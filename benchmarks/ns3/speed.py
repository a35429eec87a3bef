"""Speed: simulated over CPU time of both simulators on this machine, in turns, one process and one thread each."""

# pyright: basic, reportUnknownMemberType=false

import multiprocessing
import resource
import shutil
import statistics
import subprocess
import tempfile
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.ns3.configurations import Configuration
from benchmarks.ns3.simulators import NETWORK, in_wheel
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Payloads, SentPackets
from swarmwire.deploy.runs.record.provenance import cpu

CROWDS = {  # by the first cell of their rows
    "802.11a, to all": Configuration("802.11a", 6, 80, 128, 0.1, "area", (20.0,), seeds=1, measured_s=5.0),
    "802.11n, to the next": Configuration(
        "802.11n", 65, 80, 128, 0.1, "area", (20.0,), unicast=True, seeds=1, measured_s=5.0
    ),
}
STEP_M = 0.05  # deviation of each robot's move in a tick, along each axis
ROUNDS = 3
OURS_TIMES = 10  # as many ticks of ours as of ns-3: a tick of it takes too little to time
WARM_UP = 10  # ticks of ours that are not timed


def speed(build: Path | None) -> list[str]:
    """Lines of Markdown: each simulator standing and moving, the median of three, and ours over it."""
    with tempfile.TemporaryDirectory() as folder:
        return _speed(None if build is None else compiled(build, Path(folder) / "network"))


def _speed(program: Path | None) -> list[str]:
    factors_by_case: dict[tuple[str, str, bool], list[float]] = {}

    def keep(crowd: str, simulator: str, moving: bool, factor: float) -> None:
        factors_by_case.setdefault((crowd, simulator, moving), []).append(factor)

    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        for _, (name, crowd), moving in product(range(ROUNDS), CROWDS.items(), (False, True)):
            nodes_text = _input(crowd, moving)
            keep(name, "ours", moving, ours_factor(crowd, moving))
            keep(name, "ns-3's wheel", moving, _factor(crowd, pool.submit(in_wheel, nodes_text).result()))
            if program is not None:
                answer = subprocess.run([program], input=nodes_text, capture_output=True, text=True, check=True).stdout
                keep(name, "ns-3's build", moving, _factor(crowd, answer))
    columns = ["packets", "simulator", "robots", "x real time (lowest to highest of three)", "ours over it"]
    lines = ["| " + " | ".join(columns) + " |", "| --- " * len(columns) + "|"]
    for (crowd, simulator, moving), factors in factors_by_case.items():
        middle = statistics.median(factors)
        ratio = statistics.median(factors_by_case[crowd, "ours", moving]) / middle
        robots = "moving" if moving else "standing"
        robots += ", with the radio graph" if moving and simulator == "ours" else ""
        spread = f"{middle:.3g} ({min(factors):.3g} to {max(factors):.3g})"
        lines.append(f"| {crowd} | {simulator} | {robots} | {spread} | {ratio:.3g} |")
    return [*lines, "", f"Measured on {cpu()}."]


def _walk(crowd: Configuration, ticks: int) -> FloatArray:
    """Places by tick, (ticks, nodes, 2) in m: from those of the first seed, a random step of each in each tick."""
    steps = np.random.default_rng(1).normal(0.0, STEP_M, (ticks, crowd.nodes, 2))
    steps[0] = crowd.xy_m()[0]
    return np.cumsum(steps, axis=0)


def _input(crowd: Configuration, moving: bool) -> str:
    """What `network.cc` reads; a tick is an interval."""
    return crowd.ns3_input(0, _walk(crowd, crowd.ticks) if moving else None)


def _factor(crowd: Configuration, answer: str) -> float:
    """Simulated over CPU time, from what `network.cc` answered."""
    return crowd.counted_ns[1] / NS_PER_S / float(answer.split(maxsplit=1)[0])


def ours_factor(crowd: Configuration, moving: bool) -> float:
    """Simulated over CPU time of the medium: time passes, poses are held, packets sent, the radio graph drawn."""
    ticks = WARM_UP + OURS_TIMES * crowd.ticks
    xy_m = _walk(crowd, ticks) if moving else np.broadcast_to(crowd.xy_m()[0], (ticks, crowd.nodes, 2))
    poses = np.concatenate([xy_m, np.zeros((ticks, crowd.nodes, 1))], axis=2)
    side_m = 2.0 * float(np.abs(xy_m).max())
    context = ChannelContext.open_space(crowd.radio, crowd.keys, crowd.nodes, (side_m, side_m))
    medium = RadioMedium(context, crowd.rate_hz)
    to = np.array([crowd.receiver_of(node) for node in range(crowd.nodes)])
    payloads = Payloads.from_rows([bytes(crowd.payload_bytes)] * crowd.nodes)
    sent = SentPackets(np.arange(crowd.nodes), np.where(to < 0, BROADCAST, to), payloads)
    begun_s = 0.0
    for tick, pose in enumerate(poses):
        if tick == WARM_UP:
            begun_s = _cpu_s()
        medium.step(tick_start_ns(tick, crowd.rate_hz), pose)
        medium.send(tick_start_ns(tick, crowd.rate_hz), tick, sent)
    return (ticks - WARM_UP) * crowd.interval_s / (_cpu_s() - begun_s)


def _cpu_s() -> float:
    """CPU time of this process, in s: other programs on the machine do not count."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def compiled(build: Path, program: Path) -> Path:
    """`program`, `network.cc` with a build of ns-3 that has include/ and lib/ or lib64/; BadInput if that fails."""
    compiler = shutil.which("c++")
    libraries = sorted(each for folder in ("lib", "lib64") for each in (build / folder).glob("libns3*.so"))
    needed = [each for each in libraries if "-test" not in each.stem]
    if compiler is None or not needed:
        raise BadInput(str(build), "", "expected a C++ compiler, and an ns-3 build with include/ and lib/libns3*.so")
    folders = sorted({str(each.parent) for each in needed})
    command = [compiler, "-std=c++20", "-O3", "-DPROGRAM", f"-I{build / 'include'}", str(NETWORK), "-o", str(program)]
    command += [*map(str, needed), *(f"-Wl,-rpath,{folder}" for folder in folders)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BadInput(str(build), "", f"{NETWORK.name} does not compile: {done.stderr.strip()[:500]}")
    return program
