"""Whom a broadcast intends is told by who was alive when it was sent, as long as any such packet waits."""

import numpy as np

from swarmwire.comms.air.lives import Lives

BOTH, FIRST, NONE = np.array([True, True]), np.array([True, False]), np.zeros(0, np.int64)


def test_the_dead_are_intended_by_what_was_sent_before_they_died() -> None:
    lives = Lives(2)
    lives.now(BOTH)
    assert (lives.epoch, lives.any_dead) == (0, False)
    lives.now(FIRST)
    assert (lives.epoch, lives.any_dead) == (1, True)
    assert lives.intended(np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])).tolist() == [True, True, True, False]


def test_a_death_is_forgotten_when_all_live_again_and_nothing_of_that_time_waits() -> None:
    lives = Lives(2)
    for alive in (FIRST, BOTH):
        lives.now(alive)
    lives.forget(queued=np.array([1, 2]))
    assert lives.any_dead
    lives.forget(queued=np.array([2]))
    assert not lives.any_dead
    assert lives.intended(np.array([2, 2]), np.array([0, 1])).all()
    lives.forget(queued=NONE)
    assert not lives.any_dead
