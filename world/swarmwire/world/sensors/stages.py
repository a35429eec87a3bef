"""What goes wrong between the truth and a reading, in this order: noise, outliers, steps, range, drop-out.

Every draw is keyed by arena, robot, tick, place within the field, and purpose. Those of noise belong to the field;
whether a reading is an outlier or lost belongs to the sense, so that all its fields go together at one place.
"""

# pyright: basic, reportUnknownMemberType=false

from math import isinf
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal, uniform
from swarmwire.world.sensors.sensor import Field

NOISE, OUTLIER, OUTLYING, DROP_OUT = range(4)  # places in `purposes`
FULL_TURN = 2.0 * np.pi
LEAST_ANGLE = np.nextafter(-np.pi, 0.0)


class Numbers(NamedTuple):
    """A field's errors as the kernel takes them; `Field` says what they mean."""

    is_normal: bool
    noise: float
    relative: float
    outlier: float
    outlier_low: float
    outlier_high: float
    drop_out: float
    blank: float
    step: float
    low: float
    high: float
    angle: bool


class Stages:
    """All that one field of a sense passes through."""

    def __init__(self, sense: str, field: Field, outlier: float, drop_out: float) -> None:
        low, high = field.span or (field.low, field.high)
        self._numbers = Numbers(
            is_normal=field.noise.kind == "normal",
            noise=float(field.noise.size),
            relative=float(field.noise.relative),
            outlier=float(outlier),
            outlier_low=float(low),
            outlier_high=float(high),
            drop_out=float(drop_out),
            blank=float(field.blank),
            step=float(field.step),
            low=float(field.low),
            high=float(field.high),
            angle=field.angle,
        )
        names = f"{sense}.{field.name} noise", f"{sense} outlier", f"{sense}.{field.name} outlier", f"{sense} drop-out"
        self._purposes = np.array([purpose(name) for name in names], np.uint64)
        unbounded = isinf(field.low) and isinf(field.high) and not field.angle
        errs = field.noise.size or field.noise.relative or outlier or drop_out or field.step
        self._idle = unbounded and not errs

    def apply(self, value: FloatArray, keys: KeyArray, start: int, tick: int, running: BoolArray | None = None) -> None:
        """Put the truth `value` (arenas, n) or (arenas, n, width) through the stages, in place.

        Only in arenas that are `running` (arenas,); None: in all.
        """
        if not self._idle:
            values = value if value.ndim == 3 else value.reshape(*value.shape, 1)
            present = np.ones(len(keys), np.bool_) if running is None else running
            _apply(values, keys, present, start, tick, self._numbers, self._purposes)


@njit(cache=True)
def _apply(values, keys, running, start, tick, numbers, purposes):
    for arena in range(len(values)):
        if running[arena]:
            _apply_to(values[arena], keys[arena], start, tick, numbers, purposes)


@njit(cache=True)
def _apply_to(values, key, start, tick, numbers, purposes):
    if numbers.noise > 0.0 or numbers.relative > 0.0:
        _add_noise(values, key, start, tick, numbers, purposes[NOISE])
    if numbers.outlier > 0.0:
        _put_outliers(values, key, start, tick, numbers, purposes[OUTLIER], purposes[OUTLYING])
    flat = values.reshape(values.size)
    if numbers.step > 0.0:
        _round(flat, numbers.step)
    if numbers.low > -np.inf or numbers.high < np.inf:
        _clip(flat, numbers.low, numbers.high)
    if numbers.angle:
        _wrap(flat)
    if numbers.drop_out > 0.0:
        _drop(values, key, start, tick, numbers, purposes[DROP_OUT])


@njit(cache=True)
def _add_noise(values, key, start, tick, numbers, what_for):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            value = values[i, k]
            if np.isfinite(value):
                size = numbers.noise + numbers.relative * abs(value)
                if numbers.is_normal:
                    draw = normal(key, start + i, tick, k, what_for)
                else:
                    draw = 2.0 * uniform(key, start + i, tick, k, what_for) - 1.0
                values[i, k] = value + size * draw


@njit(cache=True)
def _put_outliers(values, key, start, tick, numbers, whether, where):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if uniform(key, start + i, tick, k, whether) < numbers.outlier:
                share = uniform(key, start + i, tick, k, where)
                low, high = numbers.outlier_low, numbers.outlier_high
                values[i, k] = low + share * (high - low)


@njit(cache=True)
def _drop(values, key, start, tick, numbers, whether):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if uniform(key, start + i, tick, k, whether) < numbers.drop_out:
                values[i, k] = numbers.blank


@njit(cache=True)
def _round(flat, step):
    for k in range(len(flat)):
        flat[k] = np.rint(flat[k] / step) * step


@njit(cache=True)
def _clip(flat, low, high):
    for k in range(len(flat)):
        if flat[k] < low and flat[k] > -np.inf:
            flat[k] = low
        elif flat[k] > high and flat[k] < np.inf:
            flat[k] = high


@njit(cache=True)
def _wrap(flat):
    for k in range(len(flat)):
        flat[k] = _wrapped(flat[k])


@njit(cache=True)
def _wrapped(angle):
    """The angle in (-pi, pi], with its own bits if it is there already (`world.placement.angles.wrapped`)."""
    if -np.pi < angle <= np.pi:
        return angle
    turned = angle - FULL_TURN * np.ceil((angle - np.pi) / FULL_TURN)
    return min(max(turned, LEAST_ANGLE), np.pi)
