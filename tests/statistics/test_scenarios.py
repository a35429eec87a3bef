"""Every shipped scenario tells its story in its summary."""

from collections.abc import Sequence

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.deploy import ArenaResult, Result, Simulation, run
from tests.support.deploy.runs import ROOT

SEEDS = range(1, 21)
# 5th percentile of the final orders of five-percent.toml without deaths, seeds 1 to 20: the slow test measures it anew.
# The 95th is 0.99937. With deaths eighteen of twenty seeds end within; seed 1, with 0.9975, is one of the two others.
UNHARMED_LOW = 0.99765
EVERYBODY_MUTE = ["events.0.do='blackout'", "events.0.robots={group='flock'}"]


def shipped(name: str, overrides: Sequence[str] = (), seeds: Sequence[int] | None = None) -> Result:
    return run(ROOT / "scenarios" / f"{name}.toml", overrides=overrides, seeds=seeds)


def final(arena: Result | ArenaResult, metric: str) -> float:
    value = arena.metrics[metric].final
    assert value is not None, metric
    return value


def test_avoidance_wanderers_neither_touch_nor_flock():
    """That they keep moving, `test_avoidance.py` tests."""
    result = shipped("avoidance")
    assert result.radio is None
    assert final(result, "collisions") <= 3
    assert final(result, "wall_contacts") <= 3
    assert (result.metrics["min_gap"].min or 0.0) > 0.0
    assert (result.metrics["order"].mean or 0.0) < 0.5


def test_crazyradio_drones_agree_through_their_station():
    """Of 10 x 9 intended receptions in a round, the station's 9 and one of each drone happen: a share of 0.2."""
    result = shipped("crazyradio")
    assert final(result, "consensus_error") < 1e-9
    assert result.radio is not None
    assert set(result.radio.fates) >= {"received", "out_of_range"}
    assert result.radio.fates["received"] == pytest.approx(0.2 * result.radio.intended, rel=0.01)


def test_maze_wanderers_keep_to_its_corridors():
    with Simulation(ROOT / "scenarios" / "maze.toml") as simulation:
        boxes = simulation.plan.static.obstacles[0]
        start = simulation.world.pose[:, :2].copy()
        simulation.run()
        x, y = simulation.world.pose[:, :2].T
    assert len(boxes) == 21
    for box in boxes:
        beyond = np.maximum(np.abs(x - box.x_m) - box.size_m[0] / 2, np.abs(y - box.y_m) - box.size_m[1] / 2)
        assert beyond.min() > 0.03  # an e-puck's radius is 0.035
    assert np.all((np.abs(x) < 1.225) & (np.abs(y) < 0.775))
    assert np.hypot(*(np.stack([x, y], axis=1) - start).T).max() > 0.3


@pytest.mark.parametrize(("name", "pdr", "latency_s"), [("flocking", 1.0, 0.0), ("flocking-lossy", 0.7, 0.11)])
def test_flocking_aligns_over_a_perfect_and_a_lossy_radio(name, pdr, latency_s):
    result = shipped(name)
    assert result.radio is not None
    assert (result.metrics["order"].min or 0.0) < 0.3
    assert final(result, "order") > 0.9
    assert final(result, "largest_component") == 1.0
    assert result.radio.link_pdr == pytest.approx(pdr, abs=0.005)
    assert result.radio.latency_air_s.p50 == pytest.approx(latency_s, abs=0.001)


def test_jammed_loses_packets_and_blocks_senders_until_its_end():
    """By 16 s the pulses are over, by 26 s the jammer that is carried."""
    clear = shipped("jammed", ["duration_s=16", "events=[]"]).radio
    pulses = shipped("jammed", ["duration_s=16"]).radio
    all_jammers = shipped("jammed", ["duration_s=26"])
    assert clear is not None
    assert pulses is not None
    assert all_jammers.radio is not None
    assert clear.fates["jammed"] == 0
    assert pulses.fates["jammed"] > 2000
    assert clear.link_pdr is not None
    assert pulses.link_pdr is not None
    assert pulses.link_pdr < clear.link_pdr - 0.05
    assert all_jammers.radio.fates["channel_busy"] > 10 * pulses.fates["channel_busy"]
    assert sum(all_jammers.radio.fates.values()) == all_jammers.radio.intended
    assert [(event.do, event.tick, event.ended) for event in all_jammers.events] == [
        ("jammer", 80, False),
        ("jammer", 160, True),
        ("jammer", 200, False),
        ("jammer", 250, True),
    ]


def test_partition_fragments_twice_and_rejoins():
    """For 10 s by halves and 6 s by blackouts; while a bridge joins its parts it holds together."""
    result = shipped("partition")
    assert result.radio is not None
    fates = result.radio.fates
    assert all(fates[name] > 0 for name in ("received", "partitioned", "blackout", "queue_full", "lost"))
    assert sum(fates.values()) == result.radio.intended
    assert final(result, "fragmentations") == 2
    assert final(result, "rejoin_worst") == pytest.approx(10.0)
    assert final(result, "rejoin_median") == pytest.approx(8.0)
    assert final(result, "unrejoined") == 0.0
    assert final(result, "largest_component") == 1.0


def test_flocking_disrupted_has_every_disruption_and_its_end():
    result = shipped("flocking-disrupted")
    assert result.radio is not None
    fates = result.radio.fates
    assert all(fates[name] > 0 for name in ("received", "lost", "receiver_dead", "blackout", "partitioned"))
    assert fates["received"] > sum(fates[name] for name in ("receiver_dead", "blackout", "partitioned"))
    assert [(event.do, event.ended) for event in result.events] == [
        ("blackout", False),
        ("kill", False),
        ("blackout", True),
        ("kill", False),
        ("kill", True),
        ("partition", False),
        ("partition", True),
        ("revive", False),
    ]


def fell_apart_and_rejoined(arena: ArenaResult) -> bool:
    apart_s = arena.metrics["rejoin_median"].final
    return (
        final(arena, "fragmentations") >= 1
        and apart_s is not None
        and np.isfinite(apart_s)
        and (final(arena, "unrejoined"), final(arena, "components")) == (0, 1)
    )


def test_split_fragments_the_flock_and_rejoins():
    """All ten seeds did when this was written."""
    arenas = shipped("split", seeds=range(1, 11)).arenas
    assert fell_apart_and_rejoined(arenas[0]), arenas[0].metrics
    assert sum(map(fell_apart_and_rejoined, arenas)) >= 8


def test_split_without_line_of_sight_never_fragments():
    """Where the signal passes through the rock the same flock never falls apart."""
    assert final(shipped("split", ["radio.line_of_sight=false"]), "fragmentations") == 0


def test_five_percent_ends_as_ordered_after_two_deaths():
    result = shipped("five-percent")
    (kill,) = result.events
    assert (kill.do, len(kill.robots[0]), result.robots) == ("kill", 2, 40)
    assert final(result, "order") >= UNHARMED_LOW


def final_orders(*overrides: str) -> FloatArray:
    return np.array([final(arena, "order") for arena in shipped("five-percent", overrides, SEEDS).arenas])


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_five_percent_survivors_match_unharmed_flocks_over_twenty_seeds():
    """One in ten of the unharmed lies outside of it as well: of twenty, more than five with p = 0.011."""
    low, high = np.quantile(final_orders("events=[]"), [0.05, 0.95])
    assert low == pytest.approx(UNHARMED_LOW, abs=1e-3)
    survivors, mute = final_orders(), final_orders(*EVERYBODY_MUTE)
    assert low <= np.median(survivors) <= high
    assert np.sum((survivors < low) | (survivors > high)) <= 5
    assert np.median(mute) < low, "or the criterion could not tell"


def test_infrared_is_blocked_by_obstacles_and_robots_only():
    shipped_run, no_bodies = shipped("infrared"), shipped("infrared", ["radio.bodies_block=false"])
    assert shipped_run.radio is not None
    assert no_bodies.radio is not None
    fates = shipped_run.radio.fates
    assert {name for name, count in fates.items() if count} == {"received", "out_of_range", "blocked", "in_flight"}
    assert fates["blocked"] > fates["received"]
    assert 0 < no_bodies.radio.fates["blocked"] < 0.15 * fates["blocked"]
    assert final(shipped_run, "largest_component") == 1.0


def test_sector_station_with_a_patch_reaches_fewer_scouts_than_in_all_directions():
    """Those beside and behind it are out of range more often."""
    patch, around = (
        shipped("sector", ["duration_s=20", *changes]).radio
        for changes in ((), ["robots.station.radio={gain_dbi=8.0, pattern={model='omnidirectional'}}"])
    )
    assert patch is not None
    assert around is not None
    assert patch.in_range < around.in_range - 2000


def test_warehouse_racks_halve_receivers_in_range_and_fragment_the_flock():
    racks, none = shipped("warehouse-wifi"), shipped("warehouse-wifi", ["arena.obstacles=[]"])
    assert racks.radio is not None
    assert none.radio is not None
    assert min(racks.radio.fates[name] for name in ("too_weak", "collided", "out_of_range")) > 1000
    assert racks.radio.in_range < 0.7 * none.radio.in_range
    assert racks.radio.fates["out_of_range"] > 2 * none.radio.fates["out_of_range"]
    assert 0.5 < (racks.radio.link_pdr or 0.0) < 0.9
    assert final(none, "fragmentations") == 0 < final(racks, "fragmentations")
