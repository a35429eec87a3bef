"""Films: what of a run folder they hold, and which ticks are shown."""

from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from swarmwire.metrics.pictures.drawing.film import MAX_BY_DEFAULT, NO_STATE, film_of, footage, states
from tests.support.metrics.films import Folder, film, ticks_frame, two_groups
from tests.support.refusals import refused_input


def test_film_holds_what_the_run_folder_does(tmp_path):
    recording = film()
    ticks_frame(recording).write_parquet(tmp_path / "ticks.parquet")
    read = film_of(Folder(tmp_path), 0, "run")
    np.testing.assert_array_equal(read.time_s, recording.time_s)
    np.testing.assert_array_equal(read.pose, recording.pose)
    np.testing.assert_array_equal(read.alive, recording.alive)
    np.testing.assert_array_equal(read.metrics["order"], recording.metrics["order"])
    assert np.isnan(read.metrics["min_gap"]).all()
    assert (read.state, read.state_names) == (None, ())


def test_parts_of_a_killed_run_are_joined_in_order_in_a_film(tmp_path):
    recording = film()
    (tmp_path / "ticks").mkdir()
    for name, rows in (("part-1", slice(20, 31)), ("part-0", slice(0, 20))):
        ticks_frame(recording)[rows].write_parquet(tmp_path / "ticks" / f"{name}.parquet")
    np.testing.assert_array_equal(film_of(Folder(tmp_path), 0, "run").pose, recording.pose)


def test_film_is_of_one_arena(tmp_path):
    recording, moved = film(), film(pose=film().pose + 1)
    both = pl.concat([ticks_frame(recording), ticks_frame(moved, arena=1)])
    both.write_parquet(tmp_path / "ticks.parquet")
    folder = Folder(tmp_path, two_groups(arenas=2))
    np.testing.assert_array_equal(film_of(folder, 1, "run").pose, moved.pose)
    with refused_input("run", "arena"):
        film_of(folder, 2, "run")


def test_run_without_a_tick_makes_no_film():
    empty = SimpleNamespace(static=two_groups(), measured={}, ticks=lambda _: ticks_frame(film())[:0])
    with refused_input("run"):
        film_of(empty, 0, "run")


def test_states_are_numbered_in_the_order_in_which_they_came_up():
    names, numbers = states(ticks_frame(film(ticks=2), states=[["", "go", ""], ["stop", "go", None]]))
    assert names == ("go", "stop")
    assert numbers is not None
    assert numbers.tolist() == [[-1, 0, -1], [1, 0, -1]]
    assert NO_STATE == -1


def test_there_are_no_states_where_no_robot_noted_any():
    assert states(ticks_frame(film(ticks=2), states=[["", "", None]] * 2)) == ((), None)


def test_tick_at_a_time_is_the_last_that_had_begun():
    recording = film()
    assert [recording.index_at(time_s) for time_s in (0.0, 0.05, 0.1, 0.3, 2.99, 99.0)] == [0, 0, 1, 3, 29, 30]


def link_pdr(frame):
    run = SimpleNamespace(static=two_groups(), measured={}, ticks=lambda _: frame)
    return film_of(run, 0, "run").metrics["link_pdr"]


def test_link_pdr_is_what_was_received_of_what_was_in_range_within_the_last_second():
    ticks = 31
    received, in_range = np.full(ticks, 3), np.full(ticks, 4)
    received[:15], in_range[0] = 0, 0
    counts = {"received": pl.Series(received), "in_range": pl.Series(in_range)}
    frame = ticks_frame(film(ticks)).with_columns(**counts)
    pdr = link_pdr(frame)
    assert np.isnan(pdr[0])
    np.testing.assert_allclose(pdr[[14, 15, 19, 24, 30]], [0.0, 0.075, 0.375, 0.75, 0.75])


def test_without_a_radio_there_is_no_link_pdr():
    none = pl.Series([None] * 31, dtype=pl.Int64)
    frame = ticks_frame(film()).with_columns(received=none, in_range=none)
    assert np.isnan(link_pdr(frame)).all()


TIME_S = np.arange(1201) / 10  # two minutes at 10 Hz
DEFAULTS = {"from_s": None, "until_s": None, "frames_per_s": None, "speed": None, "usual_frames_per_s": 10.0}


def cut(time_s=TIME_S, rate_hz=10, **options):
    return footage(time_s, rate_hz, **{**DEFAULTS, **options})


@pytest.mark.parametrize(("duration_s", "speed"), [(20, 1), (30, 1), (31, 2), (60, 2), (120, 4), (3000, 100)])
def test_film_speed_grows_until_the_film_is_short_enough(duration_s, speed):
    film_cut = cut(np.arange(duration_s * 10) / 10)
    assert film_cut.speed == speed
    assert MAX_BY_DEFAULT / 2 <= len(film_cut.ticks) <= MAX_BY_DEFAULT
    assert film_cut.ticks.tolist() == list(range(0, duration_s * 10, speed))


def test_there_are_no_more_frames_than_ticks_unless_they_are_asked_for():
    assert cut(rate_hz=10, usual_frames_per_s=25.0, speed=1.0).frames_per_s == 10.0
    film_cut = cut(frames_per_s=20.0, speed=1.0, until_s=1.0)
    assert film_cut.ticks.tolist() == sorted([*range(11), *range(10)])


def test_speed_and_frames_per_second_say_which_ticks_are_shown():
    film_cut = cut(from_s=10.0, until_s=20.0, frames_per_s=5.0, speed=2.0)
    assert film_cut.ticks.tolist() == list(range(100, 201, 4))


def test_single_tick_is_a_film_of_one_frame():
    assert cut(TIME_S[:1]).ticks.tolist() == [0]


@pytest.mark.parametrize(
    ("options", "option", "number"),
    [
        ({"from_s": 121.0}, "--from", "120"),
        ({"from_s": float("nan")}, "--from", "120"),
        ({"until_s": -1.0}, "--until", "120"),
        ({"from_s": 5.0, "until_s": 5.0}, "--until", "--from"),
        ({"frames_per_s": 0.0}, "--fps", "1000"),
        ({"speed": -1.0}, "--speed", "1000"),
        ({"speed": 0.001}, "--speed", "1200001"),
    ],
)
def test_options_that_cut_no_film_are_refused(options, option, number):
    with refused_input(option, match=number):
        cut(frames_per_s=10.0, **options) if "speed" in options else cut(**options)
