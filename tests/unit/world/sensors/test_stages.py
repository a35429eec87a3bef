"""Stages of sensors: noise, delay, rate."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.angles import wrap_angles
from swarmwire.comms.base.draws import normal, purpose, uniform
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.comms.robot.sensors.sensor import Field, Noise, SensorSpec
from swarmwire.world.sensors.pipeline import ErrorStages, SensorPipeline

KEYS = np.array([7, 8], np.uint64)
ROBOTS = np.arange(3, 8)
KEY, ROBOT, SLOT = KEYS[:, None, None], ROBOTS[None, :, None], np.arange(4)
GROUP = Group("a", load_body("epuck"), 2, 5)


def after_stages(field: Field, truth, outlier: float = 0.0, drop_out: float = 0.0, tick: int = 9):
    """A truth of the robots 3 to 7 of two arenas after all stages."""
    value = np.array(np.broadcast_to(truth, (2, 5, 4) if field.width else (2, 5)), np.float64)
    ErrorStages("sense", field, outlier, drop_out).apply(value, KEYS, 3, tick)
    return value


def draw(distribution, label: str, tick: int = 9):
    return distribution(KEY, ROBOT, tick, SLOT, purpose(label))


def test_noise_has_its_kind_and_size_and_is_keyed_by_field() -> None:
    even = after_stages(Field("value", 4, Noise("uniform", 0.2, 0.1)), -3.0)
    assert even == pytest.approx(-3.0 + 0.5 * (2.0 * draw(uniform, "sense.value noise") - 1.0))
    bell = after_stages(Field("value", 4, Noise("normal", 0.2, 0.1)), 3.0)
    assert bell == pytest.approx(3.0 + 0.5 * draw(normal, "sense.value noise"))
    single = after_stages(Field("value", 0, Noise("normal", 0.2, 0.1)), 3.0)
    assert np.array_equal(single, bell[:, :, 0])
    other_field = after_stages(Field("other", 0, Noise("normal", 0.2, 0.1)), 3.0)
    assert not (single == other_field).any()


def test_drop_out_blanks_all_fields_of_a_sensor_together() -> None:
    lost = draw(uniform, "sense drop-out") < 0.3
    assert 0 < np.count_nonzero(lost) < lost.size
    for name, blank in (("value", 0.0), ("other", np.inf), ("third", np.nan)):
        noise = Noise("uniform", 0.1)
        values = after_stages(Field(name, 4, noise, step=0.25, low=1.0, high=2.0, blank=blank), 1.6, drop_out=0.3)
        assert np.array_equal(values[lost], np.full(values[lost].shape, blank), equal_nan=True)
        assert np.all((values[~lost] >= 1.0) & (values[~lost] <= 2.0))
    assert np.isnan(after_stages(Field("value", 4), 1.0, drop_out=1.0)).all()


def test_outliers_lie_in_the_range_and_are_shared_by_fields() -> None:
    out, where = draw(uniform, "sense outlier") < 0.3, draw(uniform, "sense.value outlier")
    values = after_stages(Field("value", 4, low=-1.0, high=3.0), 0.5, outlier=0.3)
    assert values == pytest.approx(np.where(out, -1.0 + 4.0 * where, 0.5))
    assert after_stages(Field("value", 4, span=(-1.0, 3.0)), np.inf, outlier=0.3)[out] == pytest.approx(values[out])


def test_stages_apply_noise_then_steps_then_the_range() -> None:
    noisy = after_stages(Field("value", 4, Noise("uniform", 1.0)), 0.0)
    stepped = after_stages(Field("value", 4, Noise("uniform", 1.0), step=0.4), 0.0)
    assert np.array_equal(stepped, np.rint(noisy / 0.4) * 0.4)
    clipped = after_stages(Field("value", 4, Noise("uniform", 1.0), step=0.4, low=-0.5, high=0.5), 0.0)
    assert np.array_equal(clipped, np.clip(stepped, -0.5, 0.5))
    assert {-0.5, 0.5} <= set(clipped.ravel().tolist())


@given(st.floats(-50, 50))
def test_angles_are_wrapped_bit_for_bit_like_wrap_angles(angle: float) -> None:
    wrapped = after_stages(Field("value", angle=True), angle)
    assert np.array_equal(wrapped, np.broadcast_to(wrap_angles(np.array(angle)), (2, 5)))


@pytest.mark.parametrize("nothing", [np.inf, -np.inf, np.nan])
def test_values_that_are_not_finite_pass_all_stages(nothing: float) -> None:
    field = Field("value", 4, Noise("normal", 0.1, 0.1), step=0.1, low=0.0, high=1.0)
    assert np.array_equal(after_stages(field, nothing), np.full((2, 5, 4), nothing), equal_nan=True)


class Counter:
    """A sensor of the tick and of the number of ticks so far."""

    fields = (Field("tick", noise=Noise("normal", 0.01)), Field("seen", 2, blank=-1.0))

    def __init__(self) -> None:
        self.seen = 0

    def follow(self, tick: int) -> None:
        self.seen += 1

    def truth(self, tick: int) -> Any:
        self.follow(tick)
        return np.full((2, 3), float(tick)), np.full((2, 3, 2), float(self.seen))


def counter_sensor(**keys: float) -> SensorPipeline:
    return SensorPipeline("counter", Counter(), SensorSpec(**keys), KEYS, GROUP, 0.1)


def read_ticks(pipeline: SensorPipeline, ticks: int, every: int = 1) -> dict[int, dict[str, Any]]:
    """The readings of each tick in which the group acts."""
    read: dict[int, dict[str, Any]] = {}
    for tick in range(ticks):
        if tick % every:
            pipeline.follow(tick)
        else:
            read[tick] = pipeline.read(tick)
    return read


@pytest.mark.parametrize(
    ("keys", "shown"),
    [
        ({}, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ({"rate_hz": 10.0}, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ({"rate_hz": 400.0}, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
        ({"rate_hz": 5.0}, [0, 0, 2, 2, 4, 4, 6, 6, 8, 8]),
        ({"rate_hz": 4.0}, [0, 0, 0, 3, 3, 5, 5, 5, 8, 8]),
        ({"delay_s": 0.2}, [None, None, 0, 1, 2, 3, 4, 5, 6, 7]),
        ({"delay_s": 0.11}, [None, None, 0, 1, 2, 3, 4, 5, 6, 7]),
        ({"rate_hz": 2.5, "delay_s": 0.1}, [None, 0, 0, 0, 0, 4, 4, 4, 4, 8]),
    ],
)
def test_readings_follow_the_rate_and_the_delay(keys: Any, shown: list[int | None]) -> None:
    read = read_ticks(counter_sensor(**keys), 10)
    fresh, aging = read_ticks(counter_sensor(), 10), counter_sensor(**keys)
    for tick, sampled in enumerate(shown):
        aging.read(tick)
        assert aging.age(tick) == (None if sampled is None else tick - sampled)
        assert read[tick]["counter.tick"].shape == (6,)
        assert read[tick]["counter.seen"].shape == (6, 2)
        if sampled is None:
            assert np.isnan(read[tick]["counter.tick"]).all()
            assert (read[tick]["counter.seen"] == -1.0).all()
        else:
            for name in ("counter.tick", "counter.seen"):
                assert np.array_equal(read[tick][name], fresh[sampled][name])


@pytest.mark.parametrize("keys", [{}, {"rate_hz": 1.0}])
def test_failed_sensor_reads_blank_until_it_is_repaired(keys: dict[str, float]) -> None:
    pipeline = counter_sensor(**keys)
    intact = pipeline.read(0)
    pipeline.failed = np.array([[True, False, False], [False, False, True]])
    lost = pipeline.failed.ravel()
    broken = pipeline.read(1)
    assert np.array_equal(np.isnan(broken["counter.tick"]), lost)
    assert np.array_equal((broken["counter.seen"] == -1.0).all(axis=1), lost)
    assert (broken["counter.seen"][~lost] > 0.0).all()
    pipeline.failed = None
    mended = pipeline.read(2)
    assert np.isfinite(mended["counter.tick"]).all()
    assert np.array_equal(mended["counter.tick"], intact["counter.tick"]) is bool(keys)


@pytest.mark.parametrize("keys", [{}, {"rate_hz": 1.0}])
def test_writing_to_a_reading_does_not_change_the_next(keys: dict[str, float]) -> None:
    pipeline, untouched = counter_sensor(**keys), counter_sensor(**keys)
    pipeline.read(0)["counter.tick"][:] = 99.0
    untouched.read(0)
    assert np.array_equal(pipeline.read(1)["counter.tick"], untouched.read(1)["counter.tick"])
