"""LEDs show what agents switch until they switch them again; the dead are dark."""

from dataclasses import replace

import numpy as np

from swarmwire.comms.bodies.body import load_body
from swarmwire.comms.tick_io import Actions, SparseTable
from swarmwire.comms.truth import Group
from swarmwire.world.actuation.actuators import ShownLeds
from swarmwire.world.world import World
from tests.support.world.samples import posed

GROUPS = (Group("a", load_body("epuck"), 0, 2), Group("b", load_body("footbot"), 2, 3))
EVERYBODY = np.ones(6, np.bool_)


def changes(*listed: tuple[int, int, int]) -> SparseTable:
    rows, place, rgb = np.array(listed, np.int64).reshape(-1, 3).T
    return SparseTable(rows, place, rgb.astype(float))


def test_all_are_dark_at_the_start_and_there_is_room_for_the_robot_with_the_most() -> None:
    leds = ShownLeds(GROUPS, 2)
    assert leds.rgb.shape == (2, 3, 13)
    assert leds.told.shape == (6, 13)
    assert not leds.rgb.any()


def test_an_led_holds_its_colour_until_it_is_switched_again() -> None:
    leds = ShownLeds(GROUPS, 2)
    inside = leds.rgb
    leds.take(changes((4, 7, 0xFF0000), (2, 12, 0x00FF00)), EVERYBODY)
    before = leds.told
    leds.take(changes(), EVERYBODY)
    assert leds.told is before
    assert (leds.rgb[1, 1, 7], leds.rgb[0, 2, 12], np.count_nonzero(leds.rgb)) == (0xFF0000, 0x00FF00, 2)
    leds.take(changes((4, 7, 1), (4, 7, 0x0000FF), (2, 12, 0)), EVERYBODY)
    assert leds.rgb is inside
    assert (leds.told[4, 7], np.count_nonzero(leds.told)) == (0x0000FF, 1)
    assert before[4, 7] == 0xFF0000  # what an observer was told stays


def test_the_dead_go_dark_and_switch_nothing() -> None:
    leds = ShownLeds(GROUPS, 2)
    leds.take(changes((0, 0, 5), (1, 0, 6)), EVERYBODY)
    dead = np.arange(6) == 1
    leds.darken(dead)
    leds.take(changes((0, 1, 7), (1, 1, 8)), ~dead)
    assert leds.told[0, :2].tolist() == [5, 7]
    assert not leds.told[1].any()


def test_an_led_that_a_robot_does_not_have_is_counted() -> None:
    leds = ShownLeds(GROUPS, 2)
    leds.take(changes((0, 8, 5), (0, 7, 6), (2, 12, 7), (2, 2**40, 7)), EVERYBODY)
    assert leds.not_there.tolist() == [2, 0]
    assert np.count_nonzero(leds.rgb) == 2


def test_bodies_without_leds_need_no_room() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), [1, 2], {})
    assert world.actuators.leds.rgb.shape == (2, 2, 8)
    dark = ShownLeds([Group("a", replace(load_body("epuck"), leds=None), 0, 3)], 2)
    assert dark.told.shape == (6, 0)
    dark.take(changes((0, 0, 5)), EVERYBODY)
    dark.darken(EVERYBODY)
    assert dark.not_there.tolist() == [1, 0]


def test_the_world_takes_them_from_actions_and_darkens_the_dead() -> None:
    world = World(posed([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), [1], {})
    still = np.zeros(2)
    rows, drive = np.arange(2), np.zeros(2, np.bool_)
    world.move(Actions(rows, drive, still, still, still, leds=changes((0, 0, 5), (1, 3, 6), (1, 8, 9))))
    assert world.actuators.leds.told[[0, 1], [0, 3]].tolist() == [5, 6]
    world.live(np.array([True, False]))
    assert not world.actuators.leds.told[1].any()
    world.live(np.array([True, True]))
    assert np.count_nonzero(world.actuators.leds.told) == 1
    assert world.counts()["leds_not_there"].tolist() == [1]
