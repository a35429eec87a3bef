"""Speed: simulated over CPU time of both simulators on this machine, in turns, one process and one thread each."""

# pyright: basic, reportUnknownMemberType=false

import multiprocessing
import resource
import shutil
import statistics
import subprocess
import tempfile
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.ns3.configurations import Configuration, radio_like_ns3
from benchmarks.ns3.simulators import NETWORK, in_wheel
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.clock import NS_PER_S, tick_start_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.sentinels import BROADCAST
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from swarmwire.comms.robot.packets import Payloads, SentPackets
from swarmwire.deploy.runs.record.provenance import cpu

CROWD = Configuration("802.11a", 6, 80, 128, 0.1, "area", (20.0,), seeds=1, measured_s=5.0)
STEP_M = 0.05  # deviation of each robot's move in a tick, along each axis
ROUNDS = 3
OURS_TIMES = 10  # as many ticks of ours as of ns-3: a tick of it takes too little to time
WARM_UP = 10  # ticks of ours that are not timed


def speed(build: Path | None) -> list[str]:
    """Lines of Markdown: each simulator standing and moving, the median of three, and ours over it."""
    with tempfile.TemporaryDirectory() as folder:
        return _speed(None if build is None else compiled(build, Path(folder) / "network"))


def _speed(program: Path | None) -> list[str]:
    factors_by_case: dict[tuple[str, bool], list[float]] = {}
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        for _ in range(ROUNDS):
            for moving in (False, True):
                nodes_text = _input(moving)
                factors_by_case.setdefault(("ours", moving), []).append(ours_factor(moving))
                factors_by_case.setdefault(("ns-3's wheel", moving), []).append(
                    _factor(pool.submit(in_wheel, nodes_text).result())
                )
                if program is not None:
                    answer = subprocess.run(
                        [program], input=nodes_text, capture_output=True, text=True, check=True
                    ).stdout
                    factors_by_case.setdefault(("ns-3's build", moving), []).append(_factor(answer))
    lines = ["| simulator | robots | x real time (lowest to highest of three) | ours over it |", "| --- " * 4 + "|"]
    for (name, moving), factors in factors_by_case.items():
        middle = statistics.median(factors)
        ratio = statistics.median(factors_by_case["ours", moving]) / middle
        robots = "moving, with the radio graph" if moving and name == "ours" else "moving" if moving else "standing"
        lines.append(f"| {name} | {robots} | {middle:.3g} ({min(factors):.3g} to {max(factors):.3g}) | {ratio:.3g} |")
    return [*lines, "", f"Measured on {cpu()}."]


def _walk(ticks: int) -> FloatArray:
    """Places by tick, (ticks, nodes, 2) in m: from those of the first seed, a random step of each in each tick."""
    steps = np.random.default_rng(1).normal(0.0, STEP_M, (ticks, CROWD.nodes, 2))
    steps[0] = CROWD.xy_m()[0]
    return np.cumsum(steps, axis=0)


def _input(moving: bool) -> str:
    """What `network.cc` reads; a tick is an interval."""
    return CROWD.ns3_input(0, _walk(CROWD.ticks) if moving else None)


def _factor(answer: str) -> float:
    """Simulated over CPU time, from what `network.cc` answered."""
    return CROWD.counted_ns[1] / NS_PER_S / float(answer.split(maxsplit=1)[0])


def ours_factor(moving: bool) -> float:
    """Simulated over CPU time of the medium: time passes, poses are held, packets sent, the radio graph drawn."""
    ticks = WARM_UP + OURS_TIMES * CROWD.ticks
    xy_m = _walk(ticks) if moving else np.broadcast_to(CROWD.xy_m()[0], (ticks, CROWD.nodes, 2))
    poses = np.concatenate([xy_m, np.zeros((ticks, CROWD.nodes, 1))], axis=2)
    side_m = 2.0 * float(np.abs(xy_m).max())
    radio = radio_like_ns3(CROWD.standard, CROWD.rate_mbps)
    medium = RadioMedium(ChannelContext.open_space(radio, CROWD.keys, CROWD.nodes, (side_m, side_m)), CROWD.rate_hz)
    payloads = Payloads.from_rows([bytes(CROWD.payload_bytes)] * CROWD.nodes)
    sent = SentPackets(np.arange(CROWD.nodes), np.full(CROWD.nodes, BROADCAST), payloads)
    begun_s = 0.0
    for tick, pose in enumerate(poses):
        if tick == WARM_UP:
            begun_s = _cpu_s()
        medium.step(tick_start_ns(tick, CROWD.rate_hz), pose)
        medium.send(tick_start_ns(tick, CROWD.rate_hz), tick, sent)
    return (ticks - WARM_UP) * CROWD.interval_s / (_cpu_s() - begun_s)


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
