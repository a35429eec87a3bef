"""Parts that fail, at once or at a rate, each robot by its own draw; what an event cannot do is refused."""

import numpy as np
import pytest

from swarmwire.comms.clock import to_ns
from swarmwire.comms.events.effects import ActiveEffects
from swarmwire.comms.events.event import as_toml
from swarmwire.comms.events.radio_events import Ramp
from swarmwire.comms.events.robot_events import Fail, Revive
from swarmwire.comms.events.selection import Selection, Swarm

ROBOTS = 2000


def swarm(*keys: int, robots: int = ROBOTS) -> Swarm:
    return Swarm({"a": range(robots)}, robots, np.array(keys, np.uint64), np.zeros((len(keys) * robots, 3)))


def fail(part: str, *, per_hour: float | None = None, for_s: float | None = None, **robots: float) -> Fail:
    chosen = Selection(group="a", **robots)  # pyright: ignore[reportArgumentType] - share or count
    return Fail(at_s=10.0, part=part, robots=chosen, per_hour=per_hour, for_s=for_s)


def failed_after(event: Fail, of: Swarm, *at_s: float) -> list[np.ndarray]:
    """Whose part does not work at these times."""
    conditions, found = ActiveEffects(of.rows), []
    event.begin(0, of, conditions)
    for at in at_s:
        event.go_on(0, to_ns(at), of, conditions)
        found.append(conditions.failed(event.part))
    return found


def test_a_share_fails_at_once_and_works_again():
    conditions, of, event = ActiveEffects(10), swarm(7, robots=10), fail("proximity", share=0.3, for_s=5.0)
    assert event.lasts_s == 5.0
    changed = event.begin(0, of, conditions)
    assert changed.sum() == 3
    assert (conditions.failed_parts["proximity"] == changed).all()
    assert conditions.alive.all()
    assert (event.end(0, conditions) == changed).all()
    assert not conditions.failed_parts


def test_what_two_events_hold_works_only_after_both():
    conditions, of, event = ActiveEffects(4), swarm(7, robots=4), fail("motors")
    event.begin(0, of, conditions)
    assert not event.begin(1, of, conditions).any(), "they had failed already"
    assert not event.end(0, conditions).any()
    assert event.end(1, conditions).all()


def test_at_a_rate_lifetimes_are_exponential():
    # An hour at 2 per hour leaves exp(-2) of the robots; three standard errors of a share of 2,000.
    for hours in (0.25, 1.0):
        (failed,) = failed_after(fail("motors", per_hour=2.0), swarm(7), 10.0 + 3600.0 * hours)
        expected = 1.0 - np.exp(-2.0 * hours)
        assert abs(failed.mean() - expected) < 3.0 * np.sqrt(expected * (1.0 - expected) / ROBOTS)


def test_what_is_mended_fails_again_and_is_down_for_its_share_of_the_time():
    # Up for 1/rate on average, down for for_s: of 30 min and 10 min, a quarter of the time is down.
    times_s = 10.0 + 3600.0 * np.arange(2, 12)
    down = failed_after(fail("motors", per_hour=2.0, for_s=600.0), swarm(7), *times_s)
    assert abs(np.mean(down) - 0.25) < 3.0 * np.sqrt(0.25 * 0.75 / ROBOTS)


def test_neither_ticks_nor_other_arenas_matter():
    event = fail("motors", per_hour=60.0, for_s=20.0)
    often = failed_after(event, swarm(7), *(10.0 + 0.1 * np.arange(1, 1201)))[-1]
    (seldom,) = failed_after(event, swarm(7), 130.0)
    (beside,) = failed_after(event, swarm(9, 7), 130.0)
    assert often.any()
    assert (often == seldom).all()
    assert (beside[ROBOTS:] == seldom).all()


def test_a_failed_battery_is_death_until_it_is_mended_or_the_robot_revived():
    conditions, of, event = ActiveEffects(6), swarm(7, robots=6), fail("battery", count=4)
    event.begin(0, of, conditions)
    assert conditions.alive.sum() == 2
    Revive(at_s=11.0, robots=Selection(names=("a-0", "a-1", "a-2", "a-3", "a-4", "a-5"))).begin(1, of, conditions)
    assert conditions.alive.all()
    event.end(0, conditions)
    assert conditions.alive.all()


@pytest.mark.parametrize("part", ["battery", "motors"])
def test_at_a_rate_nobody_has_failed_when_it_begins(part: str):
    conditions, of = ActiveEffects(ROBOTS), swarm(7)
    event = fail(part, per_hour=1000.0)
    assert event.lasts_s is None
    assert not event.begin(0, of, conditions).any()
    began, ended = event.go_on(0, to_ns(20.0), of, conditions)
    assert began.any()
    assert not ended.any()
    assert (conditions.alive == ~began).all() if part == "battery" else conditions.alive.all()


def test_a_battery_that_fails_at_a_rate_may_fail_again_after_its_robot_was_revived():
    conditions, of = ActiveEffects(ROBOTS), swarm(7)
    event, everybody = fail("battery", per_hour=1000.0), Revive(at_s=20.0, robots=Selection(group="a"))
    event.begin(0, of, conditions)
    first, _ = event.go_on(0, to_ns(20.0), of, conditions)
    everybody.begin(1, of, conditions)
    assert conditions.alive.all()
    again, mended = event.go_on(0, to_ns(20.0), of, conditions)
    assert not again.any()
    assert (mended == first).all()
    later, _ = event.go_on(0, to_ns(60.0), of, conditions)
    assert (later & first).any()


def test_a_robot_that_is_revived_has_a_battery_whose_gauge_works():
    conditions, of = ActiveEffects(4), swarm(7, robots=4)
    fail("battery").begin(0, of, conditions)
    Revive(at_s=11.0, robots=Selection(names=("a-1",))).begin(1, of, conditions)
    assert conditions.failed("battery").tolist() == [True, False, True, True]


SWARM = Swarm({"a": range(2)}, 2, np.array([7], np.uint64), np.zeros((2, 3)))


def test_an_event_that_lasts_for_ever_or_does_not_change_by_itself_says_so() -> None:
    revive = Revive(at_s=1.0, robots=Selection(group="a"))
    with pytest.raises(TypeError, match="revive lasts for ever: there is nothing to undo"):
        revive.end(0, ActiveEffects(2))
    with pytest.raises(TypeError, match="ramp does not change by itself"):
        Ramp(at_s=1.0, what="radio.loss", to=0.5).go_on(0, 0, SWARM, ActiveEffects(2))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (True, "true"),
        (False, "false"),
        ("a", '"a"'),
        (0.5, "0.5"),
        ((1, "a"), '[1, "a"]'),
        (Selection(names=("a-0", "a-1")), '{ names = ["a-0", "a-1"] }'),
    ],
)
def test_values_are_told_as_toml(value: object, words: str) -> None:
    assert as_toml(value) == words
