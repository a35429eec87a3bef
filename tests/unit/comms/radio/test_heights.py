"""Heights of robots: distances, lines of sight, walls, bodies, two-ray and jammers in space, against closed forms."""

from collections.abc import Sequence
from dataclasses import replace
from math import dist, hypot, log10, pi

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.impairments import BearingMeasure, Measures, RangeMeasure, RssiMeasure
from swarmwire.comms.radio.config.path_loss_models import SPEED_OF_LIGHT_MPS, LogDistance, TwoRay
from swarmwire.comms.radio.config.phy import Bodies, Fading, Shadowing, Walls
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from tests.support.comms.radio import (
    RATE_HZ,
    at,
    everybody,
    in_air,
    jammed_by,
    jammers,
    make_medium,
    packets,
    run,
    with_access,
)

SIZE_M = (6.0, 5.0)
ALOHA = with_access("aloha")
RSSI = replace(with_access("none"), measures=Measures(rssi=RssiMeasure()))
WALL = Obstacle("box", 0.0, 0.0, size_m=(0.2, 4.0), height_m=1.0)
IN_SIGHT = Radio(9.0, line_of_sight=True, send_offset="tick")


def loss_db(radio: Radio, pose: FloatArray, obstacles: Sequence[Obstacle] = ()) -> float:
    """The loss from robot 0 to robot 1, which must be equal both ways, at 0 dBm and without antenna gain."""
    medium = make_medium(radio, len(pose), obstacles=[obstacles])
    result = run(medium, pose, lambda _: packets([0, 1]), 1)
    rssi_dbm = dict(zip(result.rows("received", "sender_index", "receiver"), result.measured("rssi_dbm"), strict=True))
    assert rssi_dbm[0, 1] == rssi_dbm[1, 0]
    return -float(rssi_dbm[0, 1])


def hears(radio: Radio, pose: FloatArray, obstacles: Sequence[Obstacle] = (), height_m: float = 0.0) -> bool:
    """Whether robots 0 and 1 hear one another, which the radio graph must say, too; bodies if `height_m` is not 0."""
    context = ChannelContext.open_space(radio, np.array([derive_key(1, "air")], np.uint64), len(pose), SIZE_M)
    if height_m:
        context = replace(context, radius_m=np.full(len(pose), 0.1), height_m=np.full(len(pose), height_m))
    medium = RadioMedium(context, RATE_HZ) if height_m else make_medium(radio, len(pose), obstacles=[obstacles])
    result = run(medium, pose, lambda _: packets([0, 1]), 1)
    links = {(0, 1), (1, 0)} & set(result.rows("received", "sender_index", "receiver"))
    assert len(links) in (0, 2)
    assert ([0, 1] in result.edges.tolist()) == bool(links)
    return bool(links)


@pytest.mark.parametrize("climber", [0, 1])
def test_heights_make_range_and_delay_those_in_space_and_bearing_that_in_the_plane(climber: int):
    """Three metres apart on the floor, four above one another, five in space."""
    pose = in_air((0, 0, 4.0 * (climber == 0)), (0, 3, 4.0 * (climber == 1)))
    measures = Measures(RangeMeasure(), BearingMeasure())
    radio = Radio(5.0, send_offset="tick", propagation_mps=100.0, measures=measures)
    result = run(make_medium(radio, 2), pose, lambda _: packets([0]), 1)
    assert result.measured("range_m").tolist() == [5.0]
    assert result.measured("bearing_rad").tolist() == [-pi / 2]
    at_once = run(make_medium(replace(radio, propagation_mps=None), 2), pose, lambda _: packets([0]), 1)
    late_ns = result.received("received_at_ns") - at_once.received("received_at_ns")
    assert late_ns.tolist() == [50_000_000]
    assert not hears(replace(radio, range_m=4.999), pose)
    assert hears(replace(radio, range_m=3.0), at((0, 0), (0, 3)))


def test_heights_above_the_floor_shift_path_loss_and_nothing_else():
    """Shadowing and scattered waves are those of the plane."""
    low, high = in_air((0, 0, 0), (3, 0, 0)), in_air((0, 0, 0), (3, 0, 4))
    assert loss_db(RSSI, high) == pytest.approx(46.6777 + 30.0 * log10(5.0), abs=1e-9)
    radio = replace(RSSI, shadowing=Shadowing(), fading=Fading())
    difference_db = loss_db(radio, high) - loss_db(radio, low)
    assert loss_db(radio, low) != pytest.approx(loss_db(RSSI, low), abs=0.01)
    assert difference_db == pytest.approx(30.0 * log10(5.0 / 3.0), abs=1e-4)  # shadowing has single precision


def test_heights_equal_for_all_robots_change_nothing():
    pose = np.column_stack([np.random.default_rng(2).uniform(-40.0, 40.0, (30, 3)), np.zeros(30)])
    radio = replace(with_access("csma-802154"), shadowing=Shadowing(), fading=Fading("rician"), bodies=Bodies())
    low, high = (run(make_medium(radio, 30), pose + np.array([0.0, 0.0, 0.0, z]), everybody(30), 3) for z in (0.0, 7.0))
    names = "receiver", "sender_index", "sequence", "received_at_ns"
    assert low.rows("received", *names) == high.rows("received", *names)
    assert len(low.received("receiver")) > 100


@pytest.mark.parametrize(
    ("heights_m", "wall_x_m", "is_seen"),
    [
        ((1.0, 1.0), 0.0, True),  # along its top
        ((0.5, 1.5), 0.0, False),  # 0.95 m above the floor where it leaves the wall on the low side
        ((0.5, 1.5), 0.5, True),  # 1.2 m
    ],
)
@pytest.mark.parametrize("radio", [IN_SIGHT, replace(with_access("none"), line_of_sight=True)], ids=["disk", "phy"])
def test_heights_of_drones_decide_if_they_see_one_another_over_a_wall(
    radio: Radio, heights_m: tuple[float, float], wall_x_m: float, is_seen: bool
):
    pose = in_air((-1, 0, heights_m[0]), (1, 0, heights_m[1]))
    assert hears(radio, pose, [replace(WALL, x_m=wall_x_m)]) is is_seen


def test_heights_shorten_the_way_through_a_wall():
    """From 0.5 m to 1.5 m above the floor: the line leaves through the wall's top in its middle."""
    radio = replace(RSSI, walls=Walls(crossing_db=5.0, inside_db_per_m=10.0))
    pose = in_air((-1, 0, 0.5), (1, 0, 1.5))
    more_db = loss_db(radio, pose, [WALL]) - loss_db(RSSI, pose)
    assert more_db == pytest.approx(5.0 + 10.0 * 0.1 * hypot(1.0, 0.5), abs=1e-9)
    over = in_air((-1, 0, 1.5), (1, 0, 1.5))
    assert loss_db(radio, over, [WALL]) == loss_db(RSSI, over)


@pytest.mark.parametrize(
    ("ends_m", "between_m", "is_blocked"),
    [
        ((0.0, 0.0), 0.0, True),
        ((1.0, 1.0), 1.0, True),  # all three fly at one height
        ((1.0, 1.0), 0.0, False),  # over it
        ((0.0, 0.0), 1.0, False),  # below it
        ((0.0, 0.0), 0.5, False),
        ((1.0, 1.0), 0.5, False),
        ((0.0, 1.0), 0.4, True),  # the line is 0.45 to 0.55 m high above its disc, its top 0.6 m
        ((0.0, 1.0), 0.2, False),  # its top 0.4 m
        ((0.0, 1.0), 0.6, False),
    ],
)
def test_heights_of_bodies_decide_if_they_block(ends_m: tuple[float, float], between_m: float, is_blocked: bool):
    """The body is a cylinder of 0.1 m radius and 0.2 m height, in the middle of a line of 2 m."""
    pose = in_air((-1, 0, ends_m[0]), (1, 0, ends_m[1]), (0, 0, between_m))
    assert hears(Radio(9.0, bodies_block=True, send_offset="tick"), pose, height_m=0.2) is not is_blocked
    # A PHY loses dB: so many that nothing is left.
    phy = replace(with_access("none"), bodies=Bodies(crossing_db=200.0))
    assert hears(phy, pose, height_m=0.2) is not is_blocked


def test_body_between_two_robots_above_one_another_blocks():
    radio = Radio(9.0, bodies_block=True, send_offset="tick")
    assert not hears(radio, in_air((0, 0, 0), (0, 0, 2), (0.05, 0, 1)), height_m=0.2)
    assert hears(radio, in_air((0, 0, 0), (0, 0, 2), (0.15, 0, 1)), height_m=0.2)


@pytest.mark.parametrize("z_m", [(0.0, 0.0), (10.0, 10.0), (0.0, 30.0), (5.0, 0.5)])
@pytest.mark.parametrize("apart_m", [20.0, 400.0])
def test_heights_add_to_those_of_the_antennas_of_two_ray(z_m: tuple[float, float], apart_m: float):
    radio = replace(RSSI, model="two-ray", two_ray=TwoRay(0.2, 0.2), log_distance=LogDistance(), cut_off_db=60.0)
    radio = replace(radio, log_distance=None)
    pose = in_air((0, 0, z_m[0]), (apart_m, 0, z_m[1]))
    distance_m, heights_m2 = dist((0, z_m[0]), (apart_m, z_m[1])), (z_m[0] + 0.2) * (z_m[1] + 0.2)
    friis_db = 20.0 * log10(4.0 * pi * distance_m * radio.frequency_hz / SPEED_OF_LIGHT_MPS)
    ground_db = 40.0 * log10(distance_m) - 20.0 * log10(heights_m2)
    is_near = distance_m <= 4.0 * pi * heights_m2 * radio.frequency_hz / SPEED_OF_LIGHT_MPS
    expected_db = friis_db if is_near else ground_db
    if expected_db > 100.0:  # too weak to be received
        assert not hears(radio, pose)
    else:
        assert loss_db(radio, pose) == pytest.approx(expected_db, abs=1e-9)


def test_heights_of_two_ray_are_equal_both_ways_with_two_different_antennas():
    """The product of the heights is then the mean of both directions."""
    radio = replace(RSSI, model="two-ray", two_ray=TwoRay(0.2, 0.5), log_distance=None)
    loss = loss_db(radio, in_air((0, 0, 0), (100, 0, 1)))
    heights_m2 = 0.5 * (0.2 * 1.5 + 1.2 * 0.5)
    assert loss == pytest.approx(40.0 * log10(hypot(100.0, 1.0)) - 20.0 * log10(heights_m2), abs=1e-9)


def jammed(pose: FloatArray, jammer: dict[str, float], radio: Radio, obstacles: Sequence[Obstacle] = ()) -> bool:
    """Whether robot 1 misses what robot 0 sends, next to a jammer of 20 dBm that is always on."""
    medium, now = make_medium(radio, len(pose), obstacles=[obstacles]), {0: jammed_by(jammers(jammer), len(pose))}
    result = run(medium, pose, lambda _: packets([0], 1), 1, 1, now)
    assert ([0, 1] in result.edges.tolist()) == ("RECEIVED" in result.fates())
    return "RECEIVED" not in result.fates()


def test_heights_of_jammers_are_those_of_their_carriers():
    """At 2 m the carrier is as strong as the sender + 17 dB; 2000 m up it is noise of -132 dBm."""
    near, far = in_air((0, 0, 0), (1, 0, 0), (1, 0, 2)), in_air((0, 0, 0), (1, 0, 0), (1, 0, 2000))
    assert jammed(near, {"carrier": 2}, ALOHA)
    assert not jammed(far, {"carrier": 2}, ALOHA)
    assert jammed(far, {"x_m": 1.0}, ALOHA)  # without a carrier it is on the floor


@pytest.mark.parametrize("change", [{"walls": Walls(60.0)}, {"line_of_sight": True}])
def test_heights_of_jammers_bring_them_over_walls(change: dict[str, Walls | bool]):
    radio = replace(ALOHA, **change)
    for z_m, is_jammed in ((0.0, False), (1.0, False), (3.0, True)):
        pose = in_air((0.9, 1, 0), (0.9, 0, 0), (-0.3, 0, z_m))
        assert jammed(pose, {"carrier": 2, "power_dbm": 40.0}, radio, [WALL]) is is_jammed
