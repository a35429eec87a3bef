"""Particle swarm search with noisy photocells: the own best is the brightest reading, or a mean of many."""

import pytest

from tests.support.agent.behaviours.one_particle import HERE, One, place

AGAIN_M = 0.1


def test_by_itself_the_brightest_reading_counts() -> None:
    one = One()
    for brightness in (0.5, 0.9, 0.4, 0.6):
        one.brightness = brightness
        one.step()
    assert one.memory.own_brightness[0] == pytest.approx(0.9)
    assert one.memory.own_readings[0] == 1


def test_readings_near_the_own_best_are_averaged_and_it_stays_where_it_was() -> None:
    one = One(again_m=AGAIN_M)
    for away_m, brightness in ((0.0, 0.5), (0.05, 0.9), (0.09, 0.4)):
        one.place, one.brightness = (HERE[0] + away_m, HERE[1]), brightness
        one.step()
    assert one.memory.own_brightness[0] == pytest.approx(0.6)
    assert one.memory.own_readings[0] == 3
    assert one.vector("own") == pytest.approx((-0.09, 0.0))


def test_farther_away_only_what_is_brighter_than_the_mean_takes_its_place() -> None:
    one = One(again_m=AGAIN_M)
    for brightness in (0.9, 0.5):
        one.brightness = brightness
        one.step()
    one.place, one.brightness = (HERE[0] + 0.2, HERE[1]), 0.6
    one.step()
    assert one.memory.own_readings[0] == 2
    one.brightness = 0.8  # less than the best reading, more than the mean
    one.step()
    assert one.vector("own") == (0.0, 0.0)
    assert (one.memory.own_brightness[0], one.memory.own_readings[0]) == (pytest.approx(0.8), 1)


def test_who_comes_back_measures_the_own_best_again_and_tells_its_mean() -> None:
    one = One(again_m=AGAIN_M, update_every_ticks=5, tell_before_ticks=1)
    one.brightness = 1.0
    one.step()
    one.place, one.brightness = (HERE[0] + 1.0, HERE[1]), 0.1
    one.steps(2)
    one.place, one.brightness = HERE, 0.5
    one.step()
    (told,) = [actions.sent.payloads.row(0) for actions in one.steps(1)]
    assert told == place((1.0 + 0.5 + 0.5) / 3.0, *HERE).encode()
