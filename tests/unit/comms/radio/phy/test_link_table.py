"""The links of a PHY are the same, however many threads compute them, and whether they are computed anew or kept."""

import numpy as np
import pytest

from swarmwire.comms.base.arrays import AnyArray, FloatArray
from swarmwire.comms.base.clock import tick_start_ns
from swarmwire.comms.base.threads import WORTH_ROWS
from swarmwire.comms.radio.medium import RadioMedium
from tests.support.comms.radio import METHODS, RATE_HZ, drawing, everybody, make_medium, scattered

TICKS, MANY, FEW = 4, 150, 8


def all_columns(medium: RadioMedium, poses: list[FloatArray]) -> list[AnyArray]:
    """All columns of what was received, every fate and every edge, tick by tick, while everybody sends."""
    columns: list[AnyArray] = []
    for tick, pose in enumerate(poses):
        news = medium.step(tick_start_ns(tick, RATE_HZ), pose)
        medium.send(tick_start_ns(tick, RATE_HZ), tick, everybody(len(pose))(tick))
        received, links = news.received, news.finished
        columns += [received.receiver, received.sender_index, received.sequence, received.received_at_ns]
        columns += [links.arena, links.receiver, links.sender, links.sequence, links.fate, links.final_at_ns]
        columns += [np.nan_to_num(links.rssi_dbm), news.edges, news.tally.fates, *received.measured.values()]
    return columns


def test_links_are_equal_with_any_number_of_threads():
    """Of so many robots that their links are worth another thread."""
    rng = np.random.default_rng(3)
    poses = [scattered(MANY) + rng.normal(0.0, 0.1, (MANY, 3)) for _ in range(TICKS)]
    assert MANY * (MANY - 1) // 2 > WORTH_ROWS
    radio = drawing("csma-802154")
    alone, threaded = (all_columns(make_medium(radio, MANY, threads=threads), poses) for threads in (1, 3))
    assert sum(map(len, alone)) > WORTH_ROWS
    assert all(map(np.array_equal, alone, threaded))


@pytest.mark.parametrize("method", METHODS)
def test_links_kept_equal_links_computed_anew(method: str):
    """A robot out of everybody's reach moves, or does not, while all others stand."""
    poses = [scattered(FEW) for _ in range(2 * TICKS)]
    for pose in poses:
        pose[-1, :2] = 1e5
    stand = all_columns(make_medium(drawing(method), FEW), poses)
    for tick, pose in enumerate(poses):
        pose[-1, 0] += tick
    moved = all_columns(make_medium(drawing(method), FEW), poses)
    assert sum(map(len, stand)) > 0
    assert all(map(np.array_equal, stand, moved))
