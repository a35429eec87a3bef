"""Arenas that leave a running world: each comes to what it comes to alone, whoever is beside it, for however long."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.arrays import BoolArray
from swarmwire.deploy import Result, Simulation
from swarmwire.deploy.result import ArenaResult

TICKS = 24
OVER = {1: 6, 2: 17, 3: 11, 4: 1}  # by seed, the ticks of its arena; of others all
BASE = """
format = 1
name = "leaving"
duration_s = 2.4

[arena]
size_m = [1.2, 1.0]

[robots.flock]
body = "footbot"
count = 6
place = { how = "arena", apart_m = 0.02 }
agent = "swarmwire.agent.behaviours:Flocking"
"""
DISK = """
[radio]
range_m = 0.7
loss = 0.2
bit_rate_bps = 6000
queue_limit = 3
latency_s = 0.13
jitter_s = 0.05
gives = { range = {}, bearing = {} }
"""


class Stops:
    """Says that arenas are over after so many ticks, by seed."""

    def __init__(self, seeds: Sequence[int], over: Mapping[int, int]) -> None:
        self._ticks = np.array([over.get(seed, TICKS + 1) for seed in seeds])
        self._done = 0

    def over(self) -> BoolArray | None:
        self._done += 1
        found = self._done >= self._ticks
        return found if found.any() else None


def packed(path: Path, seeds: Sequence[int], over: Mapping[int, int] = OVER, **more: Any) -> Result:
    """The result of arenas side by side, of which some are over early."""
    simulation = Simulation(path, seeds=seeds, **more)
    simulation._judge = Stops(seeds, over)  # pyright: ignore[reportPrivateUsage]
    with simulation:
        simulation.run()
    return simulation.result


def alone(path: Path, seed: int, ticks: int) -> ArenaResult:
    """What the arena of a seed comes to in a run of so many ticks, without a judge."""
    simulation = Simulation(path, seed=seed)
    with simulation:
        simulation.run(ticks)
    return simulation.result.arenas[0]


def test_it(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(BASE + DISK)
    r = packed(path, [1, 2, 3, 4, 5])
    for a in r.arenas:
        b = alone(path, a.seed, OVER.get(a.seed, TICKS))
        assert replace(b, ended=a.ended) == a
    print(r.arenas[0].radio)
