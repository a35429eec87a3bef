"""Run benchmarks and print one JSON object a line: name, value, unit, and the whole configuration.

`python -m benchmarks [--engine ENGINE] [NAME …]`. Every run is what a user's run is: the full loop with trajectory hash
and all metrics, without a run folder. The value is the median of a few runs; the machine's noise shows in their spread,
printed with it. Each benchmark has a process of its own: the memory that others leave would count in its figures.
"""

import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Callable
from functools import partial

from benchmarks.agent_overhead import agent_overhead
from benchmarks.campaign import campaign
from benchmarks.deploy_fleet import deploy_fleet
from benchmarks.first_compile import CASES as COMPILES
from benchmarks.first_compile import first_compile
from benchmarks.interfaces import interfaces, interfaces_start
from benchmarks.learn import CASES as ENVIRONMENTS
from benchmarks.learn import learn
from benchmarks.metrics_share import metrics_share
from benchmarks.motion import trace, udp, udp_use
from benchmarks.processes import BOID, processes
from benchmarks.radio import CASES as AIRS
from benchmarks.radio import air_cost, air_scaling, line_of_sight
from benchmarks.realtime import realtime
from benchmarks.record_cost import record_cost
from benchmarks.report_cost import report_cost
from benchmarks.robot_step import POLICY, robot_step
from benchmarks.robot_steps import CASES, D1, robot_steps, start
from benchmarks.tls_cost import tls_cost
from benchmarks.view_cost import view_cost
from benchmarks.wire_over_floor import wire_over_floor

REPEATS = 3
THIS = sys.executable, "-m", "benchmarks"
WITH_ENGINE: dict[str, Callable[[str, str | None, int], None]] = {
    **dict.fromkeys(CASES, robot_steps),
    "start-1000": start,
}
OTHERS: dict[str, Callable[[str, int], None]] = {
    **dict.fromkeys(ENVIRONMENTS, learn),
    "agent-overhead": agent_overhead,
    "record-cost": partial(record_cost, robots=1000, ticks=600),
    "metrics-share": partial(metrics_share, case_name="inprocess-1000-d1"),
    "metrics-share-radio": partial(metrics_share, case_name="inprocess-1000-d1-radio"),
    "view-cost": partial(view_cost, robots=1000, ticks=600, neighbours=0.0),
    "view-cost-radio": partial(view_cost, robots=1000, ticks=600, neighbours=D1),
    **dict.fromkeys(AIRS, air_cost),
    "radio-scaling": air_scaling,
    "line-of-sight-9500": line_of_sight,
    "campaign-1000x10": campaign,
    "processes-100": partial(processes, robots=100, ticks=300, agent=BOID),
    "processes-200": partial(processes, robots=200, ticks=200, agent=BOID),
    "processes-1000": partial(processes, robots=1000, ticks=50, agent=BOID),
    "wire-over-floor": partial(wire_over_floor, robots=200, ticks=140),
    "realtime-50": partial(realtime, robots=50, runners=2, subtick_s=0.001, duration_s=30.0),
    "interfaces-disk": partial(interfaces, radio="disk", robots=20, duration_s=10.0),
    "interfaces-wifi": partial(interfaces, radio="wifi", robots=20, duration_s=10.0),
    "interfaces-start-50": partial(interfaces_start, robots=50),
    "trace-1000": partial(trace, robots=1000, seconds=3600),
    "poses-udp-100": partial(udp, robots=100, rate_hz=50, seconds=10),
    "poses-udp-use": partial(udp_use, robots=100, rate_hz=50, duration_s=10.0),
    "tls-cost": partial(tls_cost, robots=40, ticks=400),
    **dict.fromkeys(COMPILES, first_compile),
    "report-10000": partial(report_cost, seeds=200),
    "robot-step": partial(robot_step, kind="epuck2"),
    "robot-step-policy": partial(robot_step, kind="epuck2", policy=POLICY),
    "robot-step-ros2": partial(robot_step, kind="ros2"),
    "deploy-20": partial(deploy_fleet, hosts=20),
}


def main() -> None:
    """Run the named benchmarks, or all."""
    parser = ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("names", nargs="*", metavar="NAME", help="all if left out")
    parser.add_argument("--engine", help="[physics] engine of inprocess, single, replicas, laser, wire and start")
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in {*WITH_ENGINE, *OTHERS}:
            parser.error(f"no benchmark {name!r}; there are {', '.join([*WITH_ENGINE, *OTHERS])}")
    names = arguments.names or [*WITH_ENGINE, *OTHERS]
    if len(names) > 1:
        engine = ["--engine", arguments.engine] if arguments.engine else []
        failed = [name for name in names if subprocess.run([*THIS, *engine, name], check=False).returncode]
        sys.exit(f"failed: {', '.join(failed)}" if failed else 0)
    (name,) = names
    if name in WITH_ENGINE:
        WITH_ENGINE[name](name, arguments.engine, REPEATS)
    else:
        OTHERS[name](name, REPEATS)


if __name__ == "__main__":
    main()
