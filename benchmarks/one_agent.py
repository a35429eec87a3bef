"""One agent file on robots of several kinds, as the table of docs/robots.md.

`python -m benchmarks.one_agent [--seeds N] [--duration S] [BODY …]` runs `examples/beacons` with each body: in
simulation over twenty seeds, with a process per robot, and in real time with the robots behind the gateway of their
protocol, driven by their drivers, over the first N of these seeds. Real time is measured for as long as simulations
are, from the first tick in which all robots have moved: they connect during the run. Run it on an idle machine: ticks
that it misses are printed, and change what robots do.
"""

from argparse import ArgumentParser
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from swarmwire.comms.arrays import FloatArray
from swarmwire.deploy import Recording, run
from swarmwire.metrics.run_folder.reader import RunFolder
from tests.support.deploy.gateways import driven

ROOT = Path(__file__).parents[1]
SCENARIO = ROOT / "examples" / "beacons" / "beacons.toml"
EMULATED_SEEDS = range(1, 21)
TABLES = Recording(rrd=False)


CONNECTED_S = 20.0  # by then all robots move
MOVING = ("vx_mps", "vy_mps", "turn_radps")


class Kind(NamedTuple):
    """A body of the scenario, and the gateway and driver of its robots."""

    body: str
    gateway: str


def _sheet(name: str) -> str:
    return str(ROOT / "scenarios" / "robots" / f"{name}.toml")


KINDS = {
    "e-puck2": Kind("epuck2", "epuck2"),
    "TurtleBot3": Kind(_sheet("turtlebot"), "ros2"),
    "TurtleBot4": Kind(_sheet("turtlebot4"), "ros2"),
    "Crazyflie": Kind(_sheet("crazyflie"), "crazyflie"),
}
MEANS = {"speed": "m/s", "nearest_neighbour": "m", "min_gap": "m", "pdr": ""}  # over ticks, with their units
COUNTS = ("collisions", "wall_contacts")


def overrides_of(kind: Kind, duration_s: float) -> tuple[str, ...]:
    """The changes of the scenario for robots of this kind."""
    return f'robots.swarm.body="{kind.body}"', f"duration_s={duration_s}"


def numbers(folder: RunFolder, duration_s: float, arena: int = 0) -> dict[str, float]:
    """The means and the counts of a run, by metric, from when all robots have moved, for this long."""
    ticks = folder.ticks(arena).sort("tick")
    moving = np.any([np.stack(ticks[name].to_list()) != 0.0 for name in MOVING], axis=0)
    if not moving.any(axis=0).all():
        raise RuntimeError(f"{folder.path}: a robot never moved")
    first, wanted = int(moving.argmax(axis=0).max()), round(duration_s * folder.static.rate_hz)
    compared = ticks[first : first + wanted]
    if len(compared) < wanted:
        raise RuntimeError(f"{folder.path}: a robot moved only after {first} ticks")
    means = {name: float(np.nanmean(compared[name].to_numpy())) for name in MEANS}
    return means | {name: float(compared[name][-1] - compared[name][0]) for name in COUNTS}


def emulated(kind: Kind, duration_s: float, seeds: Sequence[int] = EMULATED_SEEDS) -> dict[str, FloatArray]:
    """The numbers of simulated runs, all agents in this process, by metric: (seeds,)."""
    with TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        run(SCENARIO, seeds=seeds, overrides=overrides_of(kind, duration_s + 1.0), out=out, record=TABLES)
        return _columns([numbers(RunFolder(out), duration_s, arena) for arena in range(len(seeds))])


def is_same_per_process(kind: Kind, duration_s: float) -> bool:
    """Whether the run with a process per robot is the same, bit for bit."""
    overrides = overrides_of(kind, duration_s)
    one, other = (run(SCENARIO, seed=1, overrides=overrides, runners=runners) for runners in ("none", "per-robot"))
    return one.arenas[0].trajectory_sha256 == other.arenas[0].trajectory_sha256


def through_gateway(kind: Kind, duration_s: float, seed: int) -> tuple[dict[str, float], float]:
    """The numbers of a run whose robots are driven through their protocol, and the share of ticks that it missed."""
    overrides = (*overrides_of(kind, duration_s + CONNECTED_S), f"seed={seed}")
    with TemporaryDirectory() as folder:
        out = Path(folder) / "run"
        result = driven(SCENARIO, kind.gateway, out, pace=1.0, overrides=overrides, together=False, record=TABLES)
        found = numbers(RunFolder(out), duration_s)
    assert result.realtime is not None
    return found, result.realtime.missed_ticks / result.ticks


def rows(name: str, kind: Kind, duration_s: float, seeds: int) -> Iterator[str]:
    """The rows of one kind of robot."""
    expected, same = emulated(kind, duration_s), is_same_per_process(kind, duration_s)
    runs = [through_gateway(kind, duration_s, seed) for seed in range(1, seeds + 1)]
    print(name, *(f"seed {1 + i}: {missed:.1%} of the ticks missed" for i, (_, missed) in enumerate(runs)), sep="\n  ")
    found = _columns([of for of, _ in runs])
    yield _row(name, "in process", (_shown(values) for values in expected.values()))
    yield _row("", "process per robot", ["the same, bit for bit" if same else "differs"])
    within = {metric: here.min() <= found[metric].mean() <= here.max() for metric, here in expected.items()}
    cells = (_shown(values) + ("" if within[metric] else " **outside**") for metric, values in found.items())
    yield _row("", f"gateway `{kind.gateway}`", cells)


def _row(name: str, layout: str, cells: Iterable[str]) -> str:
    metrics = (*MEANS, *COUNTS)
    return f"| {' | '.join([name, layout, *cells, *[''] * len(metrics)][: 2 + len(metrics)])} |"


def _columns(runs: Sequence[dict[str, float]]) -> dict[str, FloatArray]:
    return {name: np.array([of[name] for of in runs]) for name in runs[0]}


def _shown(values: FloatArray) -> str:
    return f"{values.mean():.3g} ({values.min():.3g} to {values.max():.3g})"


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("body", nargs="*", help=f"of {', '.join(KINDS)}; default: all")
    parser.add_argument("--seeds", type=int, default=5, help="runs through each gateway")
    parser.add_argument("--duration", type=float, default=40.0, help="s of each run")
    given = parser.parse_args()
    heads = [
        f"`{name}` [{unit}]" if unit else f"`{name}`" for name, unit in (MEANS | dict.fromkeys(COUNTS, "")).items()
    ]
    table = [_row("robot", "layout", heads), _row("---", "---", ["---"] * len(heads))]
    for name in given.body or KINDS:
        table += rows(name, KINDS[name], given.duration, given.seeds)
    print("\n".join(table))


if __name__ == "__main__":
    main()
