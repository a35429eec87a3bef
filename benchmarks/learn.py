"""Steps of a whole environment for learning, on one core: sensors, radio, physics, reward and observation.

`python -m benchmarks.learn` measures VMAS's flocking beside it, in turns: it installs VMAS and PyTorch (gigabytes) into
an environment of its own, which goes with it, or takes the Python that `--vmas` names.
"""

import json
import statistics
import subprocess
import sys
import tempfile
from argparse import ArgumentParser
from pathlib import Path
from time import process_time

import numpy as np

from benchmarks.lines import print_line, spread
from benchmarks.scenes import learning
from swarmwire.agent.policy_io import Float32Array
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy.learn import ArenaState, vector_env

CASES = {"learn-100x10": 100, "learn-1000x10": 1000}
ROBOTS = 10
SECONDS = 3.0  # of processor time, so that other programs do not count
VMAS = ("vmas==1.5.2", "torch")
UV = Path(__file__).parents[1] / ".ci" / "uv"


def reward(state: ArenaState) -> FloatArray:
    """Near the others, and without contacts, (arenas,)."""
    position = state.pose[:, :, :2]
    apart_m = np.hypot(*np.moveaxis(position - position.mean(axis=1, keepdims=True), 2, 0)).mean(axis=1)
    return -apart_m - 0.1 * state.contacts.sum(axis=1)


def robot_steps(arenas: int) -> tuple[float, float]:
    """Robot-steps a second of processor time with random actions, and neighbours that each robot sees."""
    envs = vector_env(learning(ROBOTS), arenas, reward=reward, hashes=False)
    observations: Float32Array = envs.reset(seed=1)[0]
    envs.action_space.seed(1)
    actions = [envs.action_space.sample() for _ in range(10)]
    for action in actions:
        observations = envs.step(action)[0]
    steps, started_s = 0, process_time()
    while (taken_s := process_time() - started_s) < SECONDS:
        observations = envs.step(actions[steps % len(actions)])[0]
        steps += 1
    layout = envs.layouts["flock"]
    present = [index for index, name in enumerate(layout.observation) if name.endswith(" present")]
    return steps * arenas * ROBOTS / taken_s, float(observations[:, :, present].sum(axis=2).mean())


def learn(name: str, repeats: int) -> None:
    """The speed of a case."""
    runs = [robot_steps(CASES[name]) for _ in range(repeats)]
    values = [value for value, _ in runs]
    config = {"robots": ROBOTS, "arenas": CASES[name], "seconds": SECONDS, "neighbours_seen": round(runs[0][1], 2)}
    print_line(name, statistics.median(values), "robot-steps/s", {**config, **spread(values)})


def vmas_steps(python: Path, arenas: int) -> float:
    """Robot-steps a second of processor time of VMAS's flocking."""
    command = [python, Path(__file__).with_name("vmas_steps.py"), str(arenas), str(ROBOTS), str(SECONDS)]
    with tempfile.TemporaryDirectory() as elsewhere:  # where no package of ours is in the way
        done = subprocess.run(command, cwd=elsewhere, stdout=subprocess.PIPE, check=True)
    return float(json.loads(done.stdout))


def compare(python: Path, repeats: int) -> None:
    """Both, in turns, for each case."""
    for name, arenas in CASES.items():
        pairs = [(robot_steps(arenas)[0], vmas_steps(python, arenas)) for _ in range(repeats)]
        ours, theirs = ([pair[k] for pair in pairs] for k in range(2))
        print_line(name, statistics.median(ours), "robot-steps/s", {"arenas": arenas, **spread(ours)})
        print_line(f"vmas-{arenas}x{ROBOTS}", statistics.median(theirs), "robot-steps/s", spread(theirs))


def main() -> None:
    """Measure beside VMAS."""
    parser = ArgumentParser(prog="python -m benchmarks.learn")
    parser.add_argument("--vmas", type=Path, help="a Python with VMAS and PyTorch; left out: they are installed")
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.vmas:
        compare(arguments.vmas, arguments.repeats)
        return
    with tempfile.TemporaryDirectory(prefix="swarmwire-vmas-") as folder:
        python = Path(folder) / "bin" / "python"
        subprocess.run([UV, "venv", "--quiet", "--clear", "--python", sys.executable, folder], check=True)
        subprocess.run([UV, "pip", "install", "--quiet", "--python", python, *VMAS], check=True)
        compare(python, arguments.repeats)


if __name__ == "__main__":
    main()
