import numpy as np
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing.footage import MOST_BY_DEFAULT, footage

TIME_S = np.arange(1201) / 10  # two minutes at 10 Hz
DEFAULTS = {"from_s": None, "until_s": None, "frames_per_s": None, "speed": None, "usual_frames_per_s": 10.0}


def cut(time_s=TIME_S, rate_hz=10, **given):
    return footage(time_s, rate_hz, **{**DEFAULTS, **given})


@pytest.mark.parametrize(("duration_s", "speed"), [(20, 1), (30, 1), (31, 2), (60, 2), (120, 4), (3000, 100)])
def test_a_film_is_as_slow_as_its_usual_length_allows(duration_s, speed):
    found = cut(np.arange(duration_s * 10) / 10)
    assert found.speed == speed
    assert MOST_BY_DEFAULT / 2 <= len(found.ticks) <= MOST_BY_DEFAULT
    assert found.ticks.tolist() == list(range(0, duration_s * 10, speed))


def test_there_are_no_more_frames_than_ticks_unless_they_are_asked_for():
    assert cut(rate_hz=10, usual_frames_per_s=25.0, speed=1.0).frames_per_s == 10.0
    asked = cut(frames_per_s=20.0, speed=1.0, until_s=1.0)
    assert asked.ticks.tolist() == sorted([*range(11), *range(10)])


def test_speed_and_frames_per_second_say_which_ticks_are_shown():
    found = cut(from_s=10.0, until_s=20.0, frames_per_s=5.0, speed=2.0)
    assert found.ticks.tolist() == list(range(100, 201, 4))


def test_one_tick_is_a_film_of_one_frame():
    assert cut(TIME_S[:1]).ticks.tolist() == [0]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"from_s": 121.0}, "--from: expected a time that was recorded, 0 to 120 s; got 121"),
        ({"from_s": float("nan")}, "--from: expected a time that was recorded"),
        ({"until_s": -1.0}, "--until: expected a time that was recorded"),
        ({"from_s": 5.0, "until_s": 5.0}, "--until: expected a time after --from, 5 s; got 5"),
        ({"frames_per_s": 0.0}, "--fps: expected a number above 0 and at most 1000, got 0"),
        ({"speed": -1.0}, "--speed: expected a number above 0"),
        ({"speed": 0.001}, "--speed: expected no more than 20000 frames; 0.001 x makes 1200001"),
    ],
)
def test_what_is_no_film_is_refused(given, told):
    with pytest.raises(BadInput) as error:
        cut(frames_per_s=10.0, **given) if "speed" in given else cut(**given)
    assert str(error.value).startswith(told)
