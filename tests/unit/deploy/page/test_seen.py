"""The page tells where robots are, what gets through, and whom events changed, from what its observer sees."""

from dataclasses import replace

import numpy as np
import pytest

from swarmwire.comms.packets import Fate
from swarmwire.comms.run_views import ObservedTick
from swarmwire.comms.truth import EventRecord
from swarmwire.deploy.page.news import MAX_PLACES, MAX_WHO, Seen
from tests.support.metrics.truths import static, tally, truth

OF = static(robots=4)


def glimpse(tick=0, of=OF, **given):
    return ObservedTick(truth(of, tick, **given), serial=tick, ticks=1, values=np.zeros((0, 1)))


def happened(robots, ended=False):
    changed = np.zeros(4, np.bool_)
    changed[list(robots)] = True
    return EventRecord(2, 0.0, "kill", ended, changed)


def test_the_centre_is_that_of_the_robots_alive():
    seen = Seen(OF)
    assert seen.numbers["centre"] is None
    pose = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 4.0, 0.0], [9.0, 9.0, 0.0]])
    seen.see(glimpse(pose=pose, alive=np.array([True, True, True, False])))
    assert seen.numbers["centre"] == pytest.approx([4 / 3, 4 / 3], abs=1e-3)
    assert seen.numbers["places"] == [[0, 0, True], [2, 0, True], [2, 4, True], [9, 9, False]]
    seen.see(glimpse(pose=pose, alive=np.zeros(4, np.bool_)))
    assert seen.numbers["centre"] is None


def test_of_a_large_swarm_some_are_shown():
    large = static(robots=3 * MAX_PLACES)
    seen = Seen(large)
    seen.see(glimpse(of=large))
    assert len(seen.numbers["places"]) == MAX_PLACES


def test_delivery_is_that_of_the_last_simulated_second():
    seen = Seen(OF)
    seen.see(glimpse(0, tally=tally({Fate.RECEIVED: 1, Fate.LOST: 1})))
    assert seen.numbers["link_pdr"] == 0.5
    seen.see(glimpse(5, tally=tally({Fate.RECEIVED: 2})))
    assert seen.numbers["link_pdr"] == 0.75
    seen.see(glimpse(10, tally=tally({Fate.LOST: 2})))
    assert seen.numbers["link_pdr"] == 0.5
    seen.see(glimpse(30, tally=None))
    assert seen.numbers["link_pdr"] is None


@pytest.mark.parametrize(("robots", "told"), [((), "nobody"), ((1, 3), "flock-1, flock-3"), (range(4), "all")])
def test_events_say_whom_they_changed_when_they_began(robots, told):
    seen = Seen(OF)
    seen.see(glimpse(0, events=(happened(robots),)))
    seen.see(glimpse(1, events=(happened([0], ended=True),)))
    assert seen.numbers["who"] == {"2": told}


def test_of_events_without_end_the_newest_are_kept():
    seen = Seen(OF)
    for tick in range(MAX_WHO + 10):
        seen.see(glimpse(tick, events=(replace(happened([0]), serial=tick),)))
    assert list(seen.numbers["who"]) == [str(tick) for tick in range(10, MAX_WHO + 10)]


def test_of_many_robots_some_are_named():
    many = static(robots=9)
    seen = Seen(many)
    changed = np.ones(9, np.bool_)
    changed[0] = False
    event = replace(happened([]), changed=changed)
    seen.see(glimpse(of=many, events=(event,)))
    assert seen.numbers["who"]["2"] == "flock-1, flock-2, flock-3, flock-4, flock-5 and 3 more"
