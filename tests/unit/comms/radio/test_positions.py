"""Positions within a tick: held, or on the straight line between the poses of two ticks."""

from collections.abc import Sequence
from dataclasses import replace
from math import log10, pi

import numpy as np
import pytest

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.draws import derive_key
from swarmwire.comms.base.geometry.shapes import Obstacle
from swarmwire.comms.radio.config.impairments import BearingMeasure, Measures, RangeMeasure, RssiMeasure
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.medium import RadioMedium
from tests.support.comms.radio import (
    METHODS,
    RATE_HZ,
    TICK_NS,
    Run,
    at,
    drawing,
    everybody,
    in_air,
    make_medium,
    packets,
    run,
    scattered,
    story,
    with_access,
)

DISK = Radio(5.0, bit_rate_bps=10**9, measures=Measures(RangeMeasure(), BearingMeasure()), positions="interpolated")
PHY = replace(with_access("none"), positions="interpolated", measures=Measures(rssi=RssiMeasure()))
MIDDLES_NS = [(2 * part + 1) * TICK_NS // 20 for part in range(10)]  # of the tenths of a tick


def moved(medium: RadioMedium, poses: Sequence[FloatArray], sent_ns: Sequence[int]) -> Run:
    """Robot 0 sends at these times, while the robots move through one pose after the other, a tick each."""
    result = Run(medium)
    for tick, pose in enumerate(poses):
        result.news.append(medium.step(tick * TICK_NS, pose))
        for at_ns in sent_ns:
            if tick * TICK_NS <= at_ns < (tick + 1) * TICK_NS:
                medium.send_at(np.array([at_ns]), packets([0]))
    result.last = medium.end()
    return result


def test_positions_interpolated_are_on_the_line_between_two_poses():
    """From 4.5 m to 5.5 m in a tick: the packets of its first half are received, at the distance of their tenth."""
    poses = [at((0, 0), (x, 0)) for x in (4.5, 5.5, 6.5)]
    result = moved(make_medium(DISK, 2), poses, [*MIDDLES_NS, TICK_NS + 1])
    assert result.measured("range_m") == pytest.approx([4.55, 4.65, 4.75, 4.85, 4.95], abs=1e-12)
    assert result.fates() == {"RECEIVED": 5, "OUT_OF_RANGE": 6}


def test_positions_interpolated_move_in_space_and_weaken_signals():
    poses = [in_air((0, 0, 0), (3, 0, 4)), in_air((0, 0, 0), (9, 0, 12)), in_air((0, 0, 0), (9, 0, 12))]
    result = moved(make_medium(PHY, 2), poses, MIDDLES_NS)
    distance_m = 5.0 + 10.0 * (np.arange(10) + 0.5) / 10
    assert -result.measured("rssi_dbm") == pytest.approx([46.6777 + 30.0 * log10(d) for d in distance_m], abs=1e-9)


def test_positions_interpolated_turn_the_shorter_way():
    """A receiver turns from 3 rad over pi to -3 rad; the sender is at -x."""
    poses = [at((-1, 0, 0), (0, 0, heading)) for heading in (3.0, -3.0, -3.0)]
    result = moved(make_medium(DISK, 2), poses, MIDDLES_NS)
    turned_rad = (2.0 * pi - 6.0) * (np.arange(10) + 0.5) / 10
    assert result.measured("bearing_rad") == pytest.approx(pi - 3.0 - turned_rad, abs=1e-12)


def test_positions_interpolated_cross_the_seam_of_a_torus():
    """From 2.9 m over the edge at 3 m to -2.9 m: 0.2 m, not 5.8 m the other way."""
    key = np.array([derive_key(1, "air")], np.uint64)
    context = replace(ChannelContext.open_space(DISK, key, 2, (6.0, 6.0)), is_torus=True)
    poses = [at((2.5, 0), (x, 0)) for x in (2.9, -2.9, -2.9)]
    result = moved(RadioMedium(context, RATE_HZ), poses, MIDDLES_NS)
    assert result.measured("range_m") == pytest.approx(0.4 + 0.2 * (np.arange(10) + 0.5) / 10, abs=1e-12)


def test_positions_interpolated_pass_behind_an_obstacle():
    """The receiver passes behind a pillar of 0.2 m, half of the way to it: it is hidden over 0.4 m of its 2 m."""
    pillar = Obstacle("cylinder", 1.0, 0.0, radius_m=0.099)
    for radio in (replace(DISK, line_of_sight=True), replace(PHY, line_of_sight=True)):
        poses = [at((0, 0), (2, y)) for y in (-1.0, 1.0, 1.0)]
        result = moved(make_medium(radio, 2, obstacles=[[pillar]]), poses, MIDDLES_NS)
        assert result.received("sequence").tolist() == [0, 1, 2, 3, 6, 7, 8, 9]
        assert result.fates() == {"RECEIVED": 8, "BLOCKED": 2}


@pytest.mark.parametrize("method", METHODS)
def test_positions_of_robots_at_rest_are_the_same_held_and_interpolated(method: str):
    pose = scattered(8)
    stories = [
        story(run(make_medium(replace(drawing(method), positions=positions), 8), pose, everybody(8), 6, 3), 8)
        for positions in ("held", "interpolated")
    ]
    assert stories[0] == stories[1]
    assert len(stories[0]) > 50


def test_positions_interpolated_are_the_same_alone_and_beside_other_arenas():
    poses = [scattered(12, seed) for seed in (1, 2, 3)]

    def received(medium: RadioMedium, rows: slice) -> list[tuple[int, ...]]:
        result = Run(medium)
        for tick, pose in enumerate(poses):
            result.news.append(medium.step(tick * TICK_NS, pose[rows]))
            medium.send(tick * TICK_NS, tick, everybody(len(pose[rows]))(tick))
        packets = result.rows("received", "receiver", "sender_index", "sequence", "received_at_ns")
        return [row for row in packets if row[0] < 6]

    radio = replace(drawing("csma-802154"), positions="interpolated")
    together = received(make_medium(radio, 6, [1, 2]), slice(None))
    assert together == received(make_medium(radio, 6, [1]), slice(6))
    assert len(together) > 20


def test_positions_interpolated_need_the_next_poses():
    medium = make_medium(DISK, 2)
    medium.step(0, at((0, 0), (1, 0)))
    with pytest.raises(ValueError, match='positions: expected "held"'):
        medium.advance(10)
