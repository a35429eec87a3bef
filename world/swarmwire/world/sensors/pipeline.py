"""What goes wrong between the truth and a reading, in this order: noise, outliers, steps, range, drop-out.

Every draw is keyed by arena, robot, tick, place within the field, and purpose. Those of noise belong to the field;
whether a reading is an outlier or lost belongs to the sense, so that all its fields go together at one place.
"""

# pyright: basic, reportUnknownMemberType=false

from collections import deque
from math import ceil, floor, isinf
from typing import NamedTuple

import numpy as np
from numba import njit

from swarmwire.comms.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.bodies.spec import RangedSensorSpec, SensorSpec
from swarmwire.comms.draws import purpose
from swarmwire.comms.draws_compiled import normal, uniform
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Field, Following, Sensor

NOISE, OUTLIER, OUTLYING, DROP_OUT = range(4)  # places in `purposes`
FULL_TURN = 2.0 * np.pi
MIN_ANGLE = np.nextafter(-np.pi, 0.0)


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

    def __init__(self, sensor: str, field: Field, outlier: float, drop_out: float) -> None:
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
        names = (
            f"{sensor}.{field.name} noise",
            f"{sensor} outlier",
            f"{sensor}.{field.name} outlier",
            f"{sensor} drop-out",
        )
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
    return min(max(turned, MIN_ANGLE), np.pi)


# --- A sense as its group reads it: the truth at its rate, through the stages, and shown after its delay.


NEAR = 1e-9  # a tick that is due but for rounding is due

Taken = tuple[FloatArray, ...]  # a finished reading of each field, (arenas, n) or (arenas, n, width)


class Staged:
    """One sense of one group in all arenas; in each tick either `read` or `follow` is called, once.

    A reading belongs to the tick in which it was taken, so it does not matter how often the group looks. Before the
    first one is shown, as while a sensor has failed, it reads the field's `blank`.

    Attributes:
        failed: (arenas, n) robots whose sensor has failed; None: no robot's. Set from outside, effective at once.
    """

    def __init__(
        self,
        name: str,
        sensor: Sensor,
        spec: SensorSpec,
        keys: KeyArray,
        group: Group,
        tick_s: float,
        running: BoolArray | None = None,
    ) -> None:
        """The sense `name` of a group in the arenas of these keys (arenas,).

        Nobody reads it in arenas that are not `running` (arenas,), which may change; None: all always are.
        """
        self.failed: BoolArray | None = None
        self._sensor, self._keys, self._running, self._group = sensor, keys, running, group
        outlier = spec.outlier if isinstance(spec, RangedSensorSpec) else 0.0
        self._stages = [Stages(name, field, outlier, spec.drop_out) for field in sensor.fields]
        self._fields = [(f"{name}.{field.name}", (-1, field.width) if field.width else -1) for field in sensor.fields]
        self._per_tick = spec.rate_hz * tick_s  # readings; 0: one in each tick
        self._delay = ceil(spec.delay_s / tick_s - NEAR)  # ticks
        self._held = self._delay > 0 or 0.0 < self._per_tick < 1.0
        self._shown: Taken | None = None
        self._waiting: deque[tuple[int, Taken]] = deque()  # until the tick in which each is shown

    def read(self, tick: int) -> dict[str, FloatArray]:
        """Fields "sense.field" -> (rows,) or (rows, width), a row per robot of the group, arena by arena."""
        if self._held:
            self._hold(tick)
            values = tuple(value.copy() for value in self._shown) if self._shown else self._blank()
        else:
            values = self._take(tick)
        if self.failed is not None:
            for value, field in zip(values, self._sensor.fields, strict=True):
                value[self.failed] = field.blank
        return {key: value.reshape(shape) for (key, shape), value in zip(self._fields, values, strict=True)}

    def follow(self, tick: int) -> None:
        """Keep up in a tick in which the group does not act."""
        if self._held:
            self._hold(tick)
        elif isinstance(self._sensor, Following):
            self._sensor.follow(tick)

    def _take(self, tick: int) -> Taken:
        values = self._sensor.truth(tick)
        for value, stages in zip(values, self._stages, strict=True):
            stages.apply(value, self._keys, self._group.start, tick, self._running)
        return values

    def _hold(self, tick: int) -> None:
        """Take a reading if one is due, and show the newest that is old enough."""
        if self._is_due(tick):
            self._waiting.append((tick + self._delay, self._take(tick)))
        elif isinstance(self._sensor, Following):
            self._sensor.follow(tick)
        while self._waiting and self._waiting[0][0] <= tick:
            self._shown = self._waiting.popleft()[1]

    def _blank(self) -> Taken:
        shape = len(self._keys), self._group.stop - self._group.start
        return tuple(
            np.full((*shape, field.width) if field.width else shape, field.blank) for field in self._sensor.fields
        )

    def _is_due(self, tick: int) -> bool:
        per_tick = self._per_tick
        if not 0.0 < per_tick < 1.0 or tick == 0:
            return True
        return floor(tick * per_tick + NEAR) > floor((tick - 1) * per_tick + NEAR)
