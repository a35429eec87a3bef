"""One agent file on robots of several kinds, as the tables of docs/dev/validation.md and docs/tutorial-learn.md.

`python -m benchmarks.one_agent [--seeds N] [--duration S] [CASE …]` runs `examples/beacons` with each body, and the
policies of `examples/learn`: in simulation over twenty seeds, with a process per robot, and in real time with the
robots behind the gateway of their protocol, driven by their drivers, over the first N of these seeds. Real time is
measured for as long as simulations are, from the first tick in which all robots have moved: they connect during the
run. Run it on an idle machine, or at a lower `--pace`: ticks that it misses are printed, and change what robots do.
"""

from argparse import ArgumentParser
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy import Recording, run
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.deploy.gateways import driven

ROOT = Path(__file__).parents[1]
BEACONS = ROOT / "examples" / "beacons" / "beacons.toml"
POLICIES = ROOT / "examples" / "learn"
EMULATED_SEEDS = range(1, 21)
TABLES = Recording(rrd=False)
CONNECTED_S = 20.0  # by then all robots move
MOVING = ("vx_mps", "vy_mps", "turn_radps")

MEANS = {"speed": "m/s", "nearest_neighbour": "m", "min_gap": "m", "pdr": ""}  # over ticks, with their units
COUNTS = ("collisions", "wall_contacts")


class Case(NamedTuple):
    """Robots of a scenario, and the gateway and driver of their kind."""

    gateway: str
    overrides: tuple[str, ...]
    scenario: Path = BEACONS
    means: Mapping[str, str] = MEANS


def _with_body(body: str, gateway: str) -> Case:
    return Case(gateway, (f'robots.swarm.body="{body}"',))


def _sheet(name: str) -> str:
    return str(ROOT / "scenarios" / "robots" / f"{name}.toml")


def _with_policy(task: str, group: str, means: Mapping[str, str]) -> Case:
    agent = f'robots.{group}.agent="policies/{task}-lossy.onnx"'
    return Case("epuck2", (agent, f"robots.{group}.params={{}}", "radio.loss=0.3"), POLICIES / f"{task}.toml", means)


CASES = {
    "e-puck2": _with_body("epuck2", "epuck2"),
    "TurtleBot3": _with_body(_sheet("turtlebot"), "ros2"),
    "TurtleBot4": _with_body(_sheet("turtlebot4"), "ros2"),
    "Crazyflie": _with_body(_sheet("crazyflie"), "crazyflie"),
    "learned flocking": _with_policy("flocking", "flock", {"flock": "", "order": "", "min_gap": "m"}),
    "learned search": _with_policy("search", "swarm", {"target_mean": "m", "target_best": "m", "min_gap": "m"}),
}


def overrides_of(case: Case, duration_s: float) -> tuple[str, ...]:
    """The changes of the scenario, with a duration."""
    return *case.overrides, f"duration_s={duration_s}"


def numbers(folder: RunFolder, names: Iterable[str], duration_s: float, arena: int = 0) -> dict[str, float]:
    """The means of these metrics and the counts of a run, from when all robots have moved, for this long."""
    ticks = folder.ticks(arena).sort("tick")
    moving = np.any([np.stack(ticks[name].to_list()) != 0.0 for name in MOVING], axis=0)
    if not moving.any(axis=0).all():
        raise RuntimeError(f"{folder.path}: a robot never moved")
    first, tick_count = int(moving.argmax(axis=0).max()), round(duration_s * folder.static.rate_hz)
    compared = ticks[first : first + tick_count]
    if len(compared) < tick_count:
        raise RuntimeError(f"{folder.path}: a robot moved only after {first} ticks")
    means = {name: float(np.nanmean(compared[name].to_numpy())) for name in names}
    return means | {name: float(compared[name][-1] - compared[name][0]) for name in COUNTS}


def emulated(case: Case, duration_s: float, seeds: Sequence[int] = EMULATED_SEEDS) -> dict[str, FloatArray]:
    """The numbers of simulated runs, all agents in this process, by metric: (seeds,)."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        run(case.scenario, seeds=seeds, overrides=overrides_of(case, duration_s + 1.0), out=out, record=TABLES)
        return _columns([numbers(RunFolder(out), case.means, duration_s, arena) for arena in range(len(seeds))])


def is_same_per_process(case: Case, duration_s: float) -> bool:
    """Whether the run with a process per robot is the same, bit for bit."""
    overrides = overrides_of(case, duration_s)
    in_process, per_robot = (
        run(case.scenario, seed=1, overrides=overrides, runners=runners) for runners in ("none", "per-robot")
    )
    return in_process.arenas[0].trajectory_sha256 == per_robot.arenas[0].trajectory_sha256


def through_gateway(case: Case, duration_s: float, seed: int, pace: float = 1.0) -> tuple[dict[str, float], float]:
    """The numbers of a run whose robots are driven through their protocol, and the share of ticks that it missed.

    `pace` is in simulated seconds a second.
    """
    overrides = (*overrides_of(case, duration_s + CONNECTED_S), f"seed={seed}")
    with TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        result = driven(case.scenario, case.gateway, out, pace=pace, overrides=overrides, together=False, record=TABLES)
        measured = numbers(RunFolder(out), case.means, duration_s)
    assert result.realtime is not None
    return measured, result.realtime.missed_ticks / result.ticks


def rows(name: str, case: Case, duration_s: float, seeds: int, pace: float) -> Iterator[str]:
    """The rows of one case."""
    expected, same = emulated(case, duration_s), is_same_per_process(case, duration_s)
    runs = [through_gateway(case, duration_s, seed, pace) for seed in range(1, seeds + 1)]
    print(name, *(f"seed {1 + i}: {missed:.1%} of the ticks missed" for i, (_, missed) in enumerate(runs)), sep="\n  ")
    measured = _columns([values for values, _ in runs])
    yield _row(name, "in process", (_shown(values) for values in expected.values()))
    yield _row("", "process per robot", ["the same, bit for bit" if same else "differs", *[""] * (len(expected) - 1)])
    within = {metric: values.min() <= measured[metric].mean() <= values.max() for metric, values in expected.items()}
    cells = (_shown(values) + ("" if within[metric] else " **outside**") for metric, values in measured.items())
    yield _row("", f"gateway `{case.gateway}`", cells)


def _head(case: Case) -> list[str]:
    """The first rows of a table of such cases."""
    units = {**case.means, **dict.fromkeys(COUNTS, "")}
    heads = [f"`{name}` [{unit}]" if unit else f"`{name}`" for name, unit in units.items()]
    return [_row("robot", "layout", heads), _row("---", "---", ["---"] * len(heads))]


def _row(*cells: str | Iterable[str]) -> str:
    return f"| {' | '.join(text for cell in cells for text in ([cell] if isinstance(cell, str) else cell))} |"


def _columns(runs: Sequence[dict[str, float]]) -> dict[str, FloatArray]:
    return {name: np.array([values[name] for values in runs]) for name in runs[0]}


def _shown(values: FloatArray) -> str:
    return f"{values.mean():.3g} ({values.min():.3g} to {values.max():.3g})"


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("case", nargs="*", help=f"of {', '.join(CASES)}; default: all")
    parser.add_argument("--seeds", type=int, default=5, help="runs through each gateway")
    parser.add_argument("--duration", type=float, default=40.0, help="s of each run")
    parser.add_argument("--pace", type=float, default=1.0, help="simulated seconds a second, behind a gateway")
    arguments = parser.parse_args()
    lines: list[str] = []
    head: list[str] = []
    for name in arguments.case or CASES:
        if _head(CASES[name]) != head:
            head = _head(CASES[name])
            lines += ["", *head]
        lines += rows(name, CASES[name], arguments.duration, arguments.seeds, arguments.pace)
    print("\n".join(lines))


if __name__ == "__main__":
    main()
