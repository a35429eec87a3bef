"""Arenas that leave a running world: each comes to what it comes to alone, whoever is beside it, and for how long."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.arrays import BoolArray
from swarmwire.deploy import Recording, Result, RunFolder, Simulation
from swarmwire.deploy.runs import backends
from swarmwire.deploy.runs.result import ArenaResult
from swarmwire.metrics.measures.registry import METRICS
from tests.support.agent.hosts import PLAYERS
from tests.support.deploy.joiners import Watcher
from tests.support.world.locksteps import EncodedBackend

TICKS = 24
SEEDS = (1, 2, 3, 4, 5)
OVER = {1: 6, 2: 17, 3: 11, 4: 1}  # by seed, the ticks of an arena; of others all
HEAD = """
format = 1
name = "leaving"
duration_s = 2.4
"""
CHATTING = f"""
[robots.often]
body = "epuck"
count = 4
place = {{ how = "arena", apart_m = 0.02 }}
agent = "{PLAYERS}:Chatter"

[robots.seldom]
body = "footbot"
count = 3
place = {{ how = "arena", apart_m = 0.02 }}
agent = "{PLAYERS}:Chatter"
act_every_ticks = 3
"""
EVENTS = """
events = [
    { at_s = 0.3, do = "kill", robots = { count = 2 }, for_s = 0.9 },
    { at_s = 0.4, do = "blackout", robots = { count = 3 }, backlog = "all", for_s = 0.5 },
    { at_s = 0.5, do = "ramp", what = "radio.loss", to = 0.5, over_s = 1.0 },
    { at_s = 0.8, do = "revive", robots = { group = "often" } },
    { at_s = 1.3, do = "kill", robots = { group = "seldom" } },
]
"""
DISK = """
[radio]
range_m = 0.8
loss = 0.2
bit_rate_bps = 8000
queue_limit = 3
latency_s = 0.13
jitter_s = 0.05
bodies_block = true
measures = { range = {}, bearing = {} }
"""
SIGNAL = """
[radio]
preset = "ieee802154"
loss = 0.3
queue_limit = 4
access = { method = "csma-802154", max_retries = 2 }
antenna = { power_dbm = -30.0 }
log_distance = { exponent = 3.5 }
shadowing = { deviation_db = 6.0, correlation_m = 1.0 }
fading = { distribution = "rician", k = 4.0 }
measures = { range = {}, bearing = {} }
"""
ROOM = "arena = { size_m = [1.2, 1.0] }\n"
INSISTING = f"""
[robots.insisting]
body = "epuck"
count = 3
agent = "{PLAYERS}:Insisting"
act_every_ticks = 2
"""
MOVABLE = """
[arena]
size_m = [1.2, 1.0]
obstacles = [{ shape = "box", size_m = [0.1, 0.1], movable = true, mass_kg = 0.05, count = 3, place = "random" }]
"""
WORN = """
[robots.worn]
body = "worn.toml"
count = 9
place = { how = "arena", apart_m = 0.01 }
agent = "swarmwire.agent.behaviours:Diffusion"
params = { speed_mps = 0.12 }
"""
BODY = """
like = "epuck"
name = "worn"
drive = { noise = { factor_std = 0.05 } }
sensors = { proximity = { drop_out = 0.05 }, battery = { capacity_wh = 0.0006, idle_w = 1.0, drive_w_per_mps = 4.0 } }
"""
FAILING = """
events = [
    { at_s = 0.0, do = "fail", part = "motors", robots = { group = "worn" }, per_hour = 4000, for_s = 0.4 },
    { at_s = 1.6, do = "revive", robots = { count = 4 } },
]
"""
TORUS = """
[arena]
size_m = [1.2, 1.0]
boundary = "torus"
obstacles = [{ shape = "cylinder", radius_m = 0.05, count = 2, place = "random" }]
"""
WORLDS = {
    "unit-disk": HEAD + EVENTS + ROOM + CHATTING + DISK,
    "signal": HEAD + EVENTS + ROOM + CHATTING + INSISTING + SIGNAL,
    "no radio": HEAD + ROOM + CHATTING.replace("Chatter", "Counter"),
    "movable obstacles": HEAD + FAILING + MOVABLE + WORN,
    "batteries": HEAD + FAILING + ROOM + WORN,
    "torus": HEAD + 'physics = { engine = "kinematic" }\n' + TORUS + CHATTING + DISK.replace("bodies_block = true", ""),
}


class Stops:
    """Says that arenas are over after so many ticks, by seed."""

    def __init__(self, seeds: Sequence[int], over: Mapping[int, int]) -> None:
        self._ticks = np.array([over.get(seed, TICKS + 1) for seed in seeds])
        self._done = 0

    def done(self) -> BoolArray | None:
        self._done += 1
        over = self._done >= self._ticks
        return over if over.any() else None


def judged(simulation: Simulation, over: Mapping[int, int] = OVER) -> Result:
    """The result of a simulation some of whose arenas are over early."""
    simulation.stop_conditions = Stops(simulation.plan.static.seeds, over)
    with simulation:
        simulation.run()
    return simulation.result


def packed(path: Path, seeds: Sequence[int], over: Mapping[int, int] = OVER, **more: Any) -> Result:
    """The result of arenas side by side, of which some are over early."""
    return judged(Simulation(path, seeds=seeds, **more), over)


def alone(path: Path, seed: int, **more: Any) -> Result:
    """The result of an arena in a run of its own that nobody judges, cut off after as many ticks."""
    with Simulation(path, seed=seed, **more) as simulation:
        simulation.run(OVER.get(seed, TICKS))
    return simulation.result


def scenario(tmp_path: Path, name: str) -> Path:
    (tmp_path / "worn.toml").write_text(BODY)
    path = tmp_path / "leaving.toml"
    path.write_text(WORLDS[name])
    return path


def came_to(result: Result, seed: int) -> tuple[ArenaResult, list[tuple[Any, ...]]]:
    """All that is told of an arena but how it ended, and what happened in it."""
    at = [arena.seed for arena in result.arenas].index(seed)
    arena = result.arenas[at]
    events = [event for event in result.events if event.tick < arena.ticks and (event.robots[at] or not event.singly)]
    facts = [(event.at_s, event.tick, event.do, event.part, event.ended, event.robots[at]) for event in events]
    return replace(arena, ended=""), facts


@pytest.mark.parametrize("name", WORLDS)
def test_arena_that_leaves_ends_as_it_does_alone(tmp_path: Path, name: str) -> None:
    path = scenario(tmp_path, name)
    together = packed(path, SEEDS)
    for seed in (1, 5):
        assert came_to(together, seed) == came_to(alone(path, seed), seed)
    if name == "unit-disk":
        others = packed(path, (9, 3, 1, 8), {**OVER, 9: 3, 8: 12})
        for seed in (1, 3):
            assert came_to(others, seed) == came_to(together, seed)
    assert [arena.ticks for arena in together.arenas] == [6, 17, 11, 1, TICKS]
    assert [arena.ended for arena in together.arenas] == ["stopped"] * 4 + ["duration"]
    assert (together.ended, together.ticks) == ("duration", TICKS)


def test_worlds_with_arenas_that_leave_have_packets_and_faults_to_lose(tmp_path: Path) -> None:
    """Or they would show nothing: something is on its way or waits as arenas leave, and faults are counted."""
    for name in ("unit-disk", "signal"):
        result = packed(scenario(tmp_path, name), SEEDS)
        for arena in result.arenas:
            assert arena.radio.fates["in_flight"] > 0
            assert sum(arena.radio.fates.values()) == arena.radio.intended
            assert arena.counts["packets_to_nobody"] > 0
        total = {name: sum(arena.counts.get(name, 0) for arena in result.arenas) for name in result.counts}
        assert total == result.counts
        assert result.counts["clipped_commands"] > 0
    happened = {event.do for event in packed(scenario(tmp_path, "batteries"), SEEDS).events}
    assert happened == {"fail", "run_down", "revive"}


def test_arenas_leave_alike_through_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = scenario(tmp_path, "signal")
    direct = packed(path, SEEDS[:3])
    monkeypatch.setattr(backends, "LocalBackend", EncodedBackend)
    encoded = packed(path, SEEDS[:3])
    assert encoded.arenas == direct.arenas
    assert encoded.counts == direct.counts


def test_robots_of_an_arena_that_left_neither_live_move_nor_send(tmp_path: Path) -> None:
    looks = Watcher()
    packed(scenario(tmp_path, "unit-disk"), SEEDS, observers=[looks])
    rows = slice(0, 7)  # of the first arena, which leaves after tick 5
    last = looks.truths[6]
    for truth in looks.truths:
        running = [truth.tick < OVER.get(seed, TICKS) for seed in SEEDS]
        assert truth.running.tolist() == running
        if truth.tick < OVER[1]:
            continue
        assert not truth.alive[rows].any()
        assert np.array_equal(truth.pose[rows], last.pose[rows])
        assert all((group.rows >= 7).all() for group in truth.readings.values())
        assert not truth.contact_onsets[0].any()
        edges, tally, finished, departed = truth.edges, truth.tally, truth.finished, truth.departed
        assert edges is not None
        assert finished is not None
        assert departed is not None
        assert (edges >= 7).all()
        assert tally.intended[0] == tally.fates[0].sum() == 0
        assert all((packets.arena > 0).all() for packets in (finished, departed))
        assert not any(event.changed[rows].any() for event in truth.events)


def test_metrics_of_an_arena_that_leaves_are_those_of_it_alone(tmp_path: Path) -> None:
    path = scenario(tmp_path, "unit-disk")
    more = [f"metrics={[name for name, kind in METRICS.items() if not kind.standard]}"]
    together = packed(path, SEEDS, overrides=more)
    for seed in (1, 2):
        assert came_to(together, seed) == came_to(alone(path, seed, overrides=more), seed)


def test_record_of_an_arena_that_leaves_is_that_of_it_alone(tmp_path: Path) -> None:
    path, recording = scenario(tmp_path, "unit-disk"), Recording(packets=1.0, links=True, rrd=False)
    packed(path, (3, 5, 1), out=tmp_path / "together", record=recording)
    for at, seed in ((0, 3), (2, 1)):
        alone(path, seed, out=tmp_path / f"{seed}", record=recording)
        for name in ("ticks", "packets", "events", "radio_robots", "radio_distances", "radio_links"):
            own = pl.read_parquet(tmp_path / f"{seed}" / f"{name}.parquet").drop("arena")
            table = pl.read_parquet(tmp_path / "together" / f"{name}.parquet").filter(arena=at).drop("arena")
            if name == "radio_distances":
                table = table.head(len(own))  # which are as many in all arenas
            assert table.equals(own), name
    assert RunFolder(tmp_path / "together").ticks().height == 11 + TICKS + 6
