"""A chunk is due once it is large, or old; in long runs how old is a share of their time."""

from itertools import pairwise

from swarmwire.comms.clock import NS_PER_S
from swarmwire.metrics.record.chunk_limit import ChunkLimit
from tests.support.clocks import StillClock


def times_due(limit: ChunkLimit, clock: StillClock, seconds: int) -> list[int]:
    """When chunks that stay small are due."""
    due: list[int] = []
    for second in range(1, seconds + 1):
        clock.time_ns += NS_PER_S
        if limit.reached(0):
            due.append(second)
            limit.restart()
    return due


def test_a_large_chunk_is_due_at_once() -> None:
    limit = ChunkLimit(10, StillClock())
    assert not limit.reached(9)
    assert limit.reached(10)


def test_a_small_one_is_due_every_two_seconds() -> None:
    clock = StillClock()
    assert times_due(ChunkLimit(10, clock), clock, 1000) == list(range(2, 1001, 2))


def test_with_a_share_chunks_of_a_long_run_become_few() -> None:
    clock = StillClock()
    due = times_due(ChunkLimit(10, clock, 0.01), clock, 24 * 3600)
    assert due[:100] == list(range(2, 201, 2))
    assert len(due) < 800
    assert all(after - before <= max(2, 1 + 0.01 * before) for before, after in pairwise(due))
