"""What a step of an agent on a robot costs, and how much memory its process holds.

Six emulated robots stand behind gateways of a run in real time, with a process each that drives one: they flock, over
a network of their own, so that each hears five in a step and learns of six poses.
"""

import json
import statistics
import subprocess
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.lines import print_line, spread
from swarmwire.deploy import Recording, Simulation

ROOT = Path(__file__).parents[1]
ROBOTS, SECONDS = 6, 15
POLICY = ROOT / "examples" / "learn" / "policies" / "flocking-lossy.onnx"
BODIES = {"epuck2": "epuck2", "ros2": "turtlebot"}  # gateway and driver: as the scenario's name has the body


def robot_step(name: str, repeats: int, *, kind: str, policy: Path | None = None) -> None:
    """CPU time of a step (decode, agent, radio, encode), the median of all robots, and the memory of a process.

    The robots run the hand-written rule, or a trained policy.
    """
    figures = [figure for _ in range(repeats) for figure in measured(kind, policy)]
    step_ms, rss_mb = [figure["step_ms"] for figure in figures], [figure["rss_mb"] for figure in figures]
    config = {
        "driver": kind,
        "robots": ROBOTS,
        "rate_hz": 10,
        "agent": policy.name if policy else "Flocking",
        "radio": "zenoh",
        "neighbours": ROBOTS - 1,
        "tracker": True,
        "steps": sum(int(figure["steps"]) for figure in figures),
        "step_p99_ms": round(statistics.median(figure["step_p99_ms"] for figure in figures), 3),
        "process_ms_per_step": round(statistics.median(figure["process_ms"] for figure in figures), 3),
        "received_per_step": round(statistics.median(figure["received"] for figure in figures), 2),
    }
    print_line(name, statistics.median(step_ms), "ms per step", {**config, **spread(step_ms)})
    print_line(f"{name}-memory", statistics.median(rss_mb), "MB", {**config, **spread(rss_mb)})


def measured(kind: str, policy: Path | None) -> list[dict[str, float]]:
    """The figures that each robot's process prints."""
    scenario = ROOT / "scenarios" / "robots" / f"flocking-{BODIES[kind]}.toml"
    overrides = [f"robots.flock.count={ROBOTS}", f"duration_s={SECONDS + 10}"]
    if policy:
        overrides += [f"robots.flock.agent={policy}", "robots.flock.params={}"]
    with TemporaryDirectory(prefix="sw-", dir="/tmp") as folder:  # paths of sockets are short
        simulation = Simulation(
            scenario,
            gateways=kind,
            overrides=overrides,
            out=Path(folder, "run"),
            record=Recording(tables=False, rrd=False),
        )
        with simulation:
            agents = _agents(simulation, Path(folder))
            while any(agent.poll() is None for agent in agents) and simulation.tick < simulation.plan.ticks:
                simulation.step()
            return [_figures(agent) for agent in agents]


def _agents(simulation: Simulation, folder: Path) -> "list[subprocess.Popen[str]]":
    """A process for each robot, every two of them linked."""
    assert simulation.served is not None
    robots = simulation.served.robots
    at = [f"unixsock-stream/{folder}/{index}" for index in range(len(robots))]
    command = [sys.executable, "-m", "benchmarks.robot_step_agent"]
    start = partial(subprocess.Popen[str], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    return [
        start(
            [
                *command,
                str(robot.file),
                str(SECONDS),
                'radio.kind="zenoh"',
                f"network.listen={json.dumps([at[index]])}",
                f"network.connect={json.dumps([*simulation.served.endpoints, *at[:index]])}",
            ]
        )
        for index, robot in enumerate(robots)
    ]


def _figures(agent: "subprocess.Popen[str]") -> dict[str, float]:
    out, _ = agent.communicate(timeout=SECONDS + 30)
    if agent.returncode != 0:
        raise RuntimeError("an agent failed: the others' steps say nothing")
    *lines, last = out.splitlines()
    figures: dict[str, float] = json.loads(last)
    ended = lines[-1]  # "…; connections 1, packets_received 745, packets_sent 150"
    counts = dict(item.rsplit(" ", 1) for item in ended.rpartition("; ")[2].split(", "))
    return figures | {"received": int(counts.get("packets_received", "0")) / int(counts["packets_sent"])}
