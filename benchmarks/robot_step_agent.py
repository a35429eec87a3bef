"""The agent of one robot as `swarmwire-agent run` has it, whose steps are measured, and printed at the end.

`python -m benchmarks.robot_step_agent ROBOT.TOML SECONDS [KEY=VALUE …]`; it imports little that the agent does not.
"""

# Steps are measured from outside, so that robots need no code for it.
# pyright: reportPrivateUsage=false

import json
import sys
import time
from pathlib import Path

from swarmwire.agent.on_robot.assembly import run_robot
from swarmwire.agent.on_robot.log import TickRow
from swarmwire.agent.on_robot.loop import RobotLoop
from swarmwire.agent.on_robot.plan import robot_config
from swarmwire.agent.on_robot.safety import StopFlag
from swarmwire.agent.on_robot.settings import read_settings
from swarmwire.comms.base.clock import WallClock

WARM_UP = 30  # steps that are left out: what is called for the first time takes longer


class MeasuredSteps:
    """CPU time of each step: of the loop's thread, and, since the warm-up, of the whole process."""

    def __init__(self) -> None:
        self.thread_ns: list[int] = []
        self._warm_ns = 0
        step, steps = RobotLoop._step, self

        def measured(self: RobotLoop, tick: int, late: bool) -> TickRow:
            began_ns = time.thread_time_ns()
            row = step(self, tick, late)
            steps._add(time.thread_time_ns() - began_ns)
            return row

        RobotLoop._step = measured

    def _add(self, taken_ns: int) -> None:
        self.thread_ns.append(taken_ns)
        if len(self.thread_ns) == WARM_UP:
            self._warm_ns = time.process_time_ns()

    def figures(self) -> dict[str, float]:
        """What a step took, in ms: the median and the longest but one in a hundred, and with all threads the mean."""
        steps = sorted(self.thread_ns[WARM_UP:])
        process_ms = (time.process_time_ns() - self._warm_ns) / len(steps) / 1e6
        median_ms, p99_ms = (steps[round(share * (len(steps) - 1))] / 1e6 for share in (0.5, 0.99))
        return {"step_ms": median_ms, "step_p99_ms": p99_ms, "process_ms": process_ms, "steps": len(steps)}


def main() -> None:
    """Run it, and print what it took as JSON, last of all."""
    file, seconds, *settings = sys.argv[1:]
    steps, clock = MeasuredSteps(), WallClock()
    flags = {key: (key, json.loads(value)) for key, _, value in (text.partition("=") for text in settings)}
    plan = robot_config(read_settings(Path(file), flags), file, clock)
    run_robot(plan, clock, StopFlag(), "measured", float(seconds))
    print(json.dumps(steps.figures() | {"rss_mb": most_memory_mb()}), flush=True)


def most_memory_mb() -> float:
    """The most memory that this process held; ru_maxrss would tell its parent's, if that was more."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1e3


if __name__ == "__main__":
    main()
