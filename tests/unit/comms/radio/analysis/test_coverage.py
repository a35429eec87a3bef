"""Coverage is what the medium would do between robots at those places, and surveys show it truly.

Keys are fixed; shares are held to 4.4 standard errors, a false alarm of 1 in 90 000 each.
"""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.draws import derive_key
from swarmwire.comms.geometry.obstacles import obstacle_arrays
from swarmwire.comms.radio.analysis.coverage import Coverage, by_distance, coverage_map
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Access, Antenna, Fading, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.phy.propagation import cut_off_dbm
from swarmwire.comms.truth import Obstacle
from tests.support.comms.radio.phy.radios import IEEE_802_15_4
from tests.support.comms.radio.runs import SIZE_M, at, everybody, make_medium, packets, run, scattered

OBSTACLES = [Obstacle("cylinder", 0.5, 0.5, radius_m=0.4), Obstacle("box", -1.0, -1.0, 0.3, size_m=(1.5, 0.4))]
DISK = Radio(2.5, loss=0.1, bursts=Bursts(1.0, 9.0))
# So weak that a few metres decide.
WEAK = replace(IEEE_802_15_4, antenna=Antenna(-42.0), access=Access("none"), min_delivery=0.3)
SHADED = replace(WEAK, walls=Walls(6.0, 3.0), shadowing=Shadowing(6.0, 1.0))
ROBOTS = 40


def coverage_of(radio: Radio, obstacles: list[Obstacle] | None = None, payload_bytes: int = 10) -> Coverage:
    """Of the arena with seed 1."""
    key = derive_key(1, "air")
    return Coverage(radio, np.uint64(key), obstacle_arrays((tuple(obstacles or ()),)), payload_bytes)


@pytest.mark.parametrize(
    "radio", [DISK, replace(DISK, line_of_sight=False), WEAK, SHADED, replace(SHADED, range_m=2.0)]
)
def test_the_radio_graph_has_the_pairs_with_enough_delivery(radio: Radio):
    pose = scattered(ROBOTS)
    medium = make_medium(radio, ROBOTS, obstacles=[OBSTACLES])
    edges = medium.step(0, pose).edges
    a, b = np.triu_indices(ROBOTS, 1)
    coverage = coverage_of(radio, OBSTACLES, radio.max_payload_bytes)
    joined = coverage.delivery(pose[a, :2], pose[b, :2]) >= radio.min_delivery - 1e-9
    np.testing.assert_array_equal(edges, np.stack([a[joined], b[joined]], axis=1))
    assert 50 < len(edges) < len(a) - 50


def test_the_mean_strength_is_that_of_packets_received():
    pose = scattered(ROBOTS)
    told = run(make_medium(SHADED, ROBOTS, obstacles=[OBSTACLES]), pose, everybody(ROBOTS), 1, 1)
    received = told.finished("fate") == 0
    sender, receiver = told.finished("sender")[received], told.finished("receiver")[received]
    mean_dbm = coverage_of(SHADED, OBSTACLES).mean_dbm(pose[sender, :2], pose[receiver, :2])
    assert len(sender) > 200
    assert mean_dbm is not None
    # The medium's links have their shadowing in single precision.
    off_db = np.abs(told.finished("rssi_dbm")[received] - mean_dbm)
    assert np.median(off_db) < 1e-4
    assert off_db.max() < 0.1


@pytest.mark.parametrize("fading", [None, Fading("rayleigh"), Fading("rician", k=3.0), Fading("nakagami", m=0.7)])
def test_delivery_is_the_share_of_lone_packets_that_are_received(fading: Fading | None):
    """A pair in each of a thousand arenas, whose fading is their own, where about half of the packets get through."""
    radio, x_m = replace(WEAK, fading=fading), np.linspace(-2.0, 2.9, 500)
    end = np.stack([x_m, np.zeros(500)], axis=1)
    delivery = coverage_of(radio).delivery(np.broadcast_to(np.array([-2.9, 0.0]), end.shape), end)
    halfway = int(np.argmin(np.abs(delivery - 0.5)))
    expected, pose = float(delivery[halfway]), at((-2.9, 0.0), (x_m[halfway], 0.0))
    medium = make_medium(radio, 2, range(1000))
    told = run(medium, np.tile(pose, (1000, 1)), lambda _: packets(range(0, 2000, 2)), 1, 1)
    share = len(told.received("receiver")) / 1000
    assert 0.3 < expected < 0.7
    # The coverage's own sample of gains, twice as many, has an error, too.
    assert abs(share - expected) < 4.4 * np.sqrt(1.5 * expected * (1.0 - expected) / 1000)


def test_nothing_is_delivered_below_the_cut_off():
    """Fading lifts some packets above the noise from just below it.

    The medium leaves such links out if it is told to.
    """
    near, far = (replace(WEAK, fading=Fading("rayleigh"), cut_off_db=below_db) for below_db in (0.0, 10.0))
    end = np.stack([np.linspace(1.0, 20.0, 500), np.zeros(500)], axis=1)
    mean_dbm = coverage_of(near).mean_dbm(np.zeros_like(end), end)
    assert mean_dbm is not None
    below = np.flatnonzero(mean_dbm < cut_off_dbm(near))[:1]
    found = [coverage_of(radio).delivery(np.zeros((1, 2)), end[below])[0] for radio in (near, far)]
    assert found[0] == 0.0
    assert found[1] > 0.01


def test_a_map_shows_reach_shade_and_what_obstacles_cover():
    found = coverage_map(coverage_of(DISK, OBSTACLES), SIZE_M, (0.0, 0.0), 60)
    assert found.delivery.shape == found.in_range.shape == (len(found.y_m), len(found.x_m)) == (50, 60)
    x_m, y_m = np.meshgrid(found.x_m, found.y_m)
    covered = np.hypot(x_m - 0.5, y_m - 0.5) < 0.4
    assert not found.is_free[covered].any()
    assert not found.in_range[np.hypot(x_m, y_m) > 2.5].any()
    behind = (np.hypot(x_m - y_m, 0.0) < 0.2) & (x_m > 0.9)
    assert behind.any()
    assert not found.in_range[behind].any()
    clear = (np.hypot(x_m, y_m) < 2.4) & (y_m > 0.1) & (x_m < 0.0)
    assert found.in_range[clear].all()
    assert np.unique(found.delivery[found.in_range]).tolist() == pytest.approx([0.9 * 0.9])
    assert found.mean_dbm is None
    assert 0.4 < found.share(found.in_range) < 0.65


def test_over_distance_a_disk_is_whole_up_to_its_range_and_signals_fall():
    key = np.uint64(7)
    of_disk = by_distance(coverage_of(replace(DISK, bursts=None, loss=0.0)), SIZE_M, key, 20.0, 80)
    assert of_disk.mean_dbm is None
    np.testing.assert_array_equal(of_disk.delivery.mean, of_disk.distance_m < 2.5)
    assert 5.0 < of_disk.distance_m[-1] < np.hypot(*SIZE_M)
    bare, shaded = (by_distance(coverage_of(radio, OBSTACLES), SIZE_M, key, 6.0, 20) for radio in (WEAK, SHADED))
    assert (np.diff(bare.delivery.mean) <= 0.0).all()
    np.testing.assert_allclose(bare.delivery.low, bare.delivery.high, atol=1e-9)
    assert (shaded.delivery.low <= shaded.delivery.high).all()
    assert (shaded.delivery.high - shaded.delivery.low).max() > 0.5
    assert bare.mean_dbm is not None
    assert shaded.mean_dbm is not None
    assert (shaded.mean_dbm.mean < bare.mean_dbm.mean - 0.5)[10:].all()
