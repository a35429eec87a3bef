"""The sensor pipeline: from the truth to a reading.

`ErrorStages` applies the errors of one field, in this order: noise, outliers, quantization steps, range, drop-out.
`SensorPipeline` is one sensor of one group: truth at the sensor's rate, then the stages, then the delay.

Every draw is keyed by arena, robot, tick, index within the field, and purpose. Draws of noise belong to the field.
Draws of outliers and drop-outs belong to the sensor, so all its fields fail together at one index.
"""

# pyright: basic, reportUnknownMemberType=false

from collections import deque
from math import ceil, floor, isinf
from typing import NamedTuple

import numpy as np

from swarmwire.comms.base.angles import wrap_angle
from swarmwire.comms.base.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.base.draws import purpose
from swarmwire.comms.base.draws_compiled import normal, uniform
from swarmwire.comms.base.kernels import njit
from swarmwire.comms.observe.truth import Group
from swarmwire.comms.robot.sensors.sensor import Field, RangedSensorSpec, SensorSpec
from swarmwire.world.sensors.sensor import Sensor

wrap = njit()(wrap_angle)
NOISE, OUTLIER, OUTLIER_VALUE, DROP_OUT = range(4)  # indices of `purposes`
ROUNDING = 1e-9  # share of a tick: a reading or delay that misses a tick by less belongs to it

Reading = tuple[FloatArray, ...]  # the reading of each field, (arenas, n) or (arenas, n, width)


class ErrorParams(NamedTuple):
    """The errors of a field for the kernels; `Field` defines the numbers."""

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


class ErrorStages:
    """The error stages of one field of a sensor."""

    def __init__(self, sensor: str, field: Field, outlier: float, drop_out: float) -> None:
        low, high = field.span or (field.low, field.high)
        self._params = ErrorParams(
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
        has_errors = field.noise.size or field.noise.relative or outlier or drop_out or field.step
        self._idle = unbounded and not has_errors

    def apply(self, value: FloatArray, keys: KeyArray, start: int, tick: int, running: BoolArray | None = None) -> None:
        """Apply the stages to the truth `value` (arenas, n) or (arenas, n, width), in place.

        Only arenas that are `running` (arenas,) change; None: all arenas.
        """
        if not self._idle:
            values = value if value.ndim == 3 else value.reshape(*value.shape, 1)
            active = np.ones(len(keys), np.bool_) if running is None else running
            _apply(values, keys, active, start, tick, self._params, self._purposes)


@njit()
def _apply(values, keys, running, start, tick, params, purposes):
    for arena in range(len(values)):
        if running[arena]:
            _apply_to(values[arena], keys[arena], start, tick, params, purposes)


@njit()
def _apply_to(values, key, start, tick, params, purposes):
    if params.noise > 0.0 or params.relative > 0.0:
        _add_noise(values, key, start, tick, params, purposes[NOISE])
    if params.outlier > 0.0:
        _add_outliers(values, key, start, tick, params, purposes[OUTLIER], purposes[OUTLIER_VALUE])
    flat = values.reshape(values.size)
    if params.step > 0.0:
        _round(flat, params.step)
    if params.low > -np.inf or params.high < np.inf:
        _clip(flat, params.low, params.high)
    if params.angle:
        _wrap(flat)
    if params.drop_out > 0.0:
        _drop(values, key, start, tick, params, purposes[DROP_OUT])


@njit()
def _add_noise(values, key, start, tick, params, noise_purpose):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            value = values[i, k]
            if np.isfinite(value):
                size = params.noise + params.relative * abs(value)
                if params.is_normal:
                    draw = normal(key, start + i, tick, k, noise_purpose)
                else:
                    draw = 2.0 * uniform(key, start + i, tick, k, noise_purpose) - 1.0
                values[i, k] = value + size * draw


@njit()
def _add_outliers(values, key, start, tick, params, selection_purpose, value_purpose):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if uniform(key, start + i, tick, k, selection_purpose) < params.outlier:
                fraction = uniform(key, start + i, tick, k, value_purpose)
                low, high = params.outlier_low, params.outlier_high
                values[i, k] = low + fraction * (high - low)


@njit()
def _drop(values, key, start, tick, params, selection_purpose):
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            if uniform(key, start + i, tick, k, selection_purpose) < params.drop_out:
                values[i, k] = params.blank


@njit()
def _round(flat, step):
    for k in range(len(flat)):
        flat[k] = np.rint(flat[k] / step) * step


@njit()
def _clip(flat, low, high):
    for k in range(len(flat)):
        if flat[k] < low and flat[k] > -np.inf:
            flat[k] = low
        elif flat[k] > high and flat[k] < np.inf:
            flat[k] = high


@njit()
def _wrap(flat):
    for k in range(len(flat)):
        flat[k] = wrap(flat[k])


class SensorPipeline:
    """One sensor of one group in all arenas; in each tick either `read` or `follow` is called, once.

    A reading belongs to the tick in which it was measured, so it does not depend on how often the group reads. Before
    the first reading, and while a sensor has failed, a field reads its `blank`.

    Attributes:
        name: the sensor's name.
        failed: (arenas, n) robots whose sensor has failed; None: no robots. Set from outside, effective at once.
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
        """Make the sensor `name` of a group in the arenas of these keys (arenas,).

        Agents read it only in arenas that are `running` (arenas,), which may change; None: all arenas.
        """
        self.name = name
        self.failed: BoolArray | None = None
        self._sensor, self._keys, self._running, self._group = sensor, keys, running, group
        outlier = spec.outlier if isinstance(spec, RangedSensorSpec) else 0.0
        self._fields = tuple(sensor.fields)
        self._stages = [ErrorStages(name, field, outlier, spec.drop_out) for field in self._fields]
        self._columns = [(f"{name}.{field.name}", (-1, field.width) if field.width else -1) for field in self._fields]
        self._readings_per_tick = spec.rate_hz * tick_s  # 0: one in each tick
        self._delay_ticks = ceil(spec.delay_s / tick_s - ROUNDING)
        self._samples = self._delay_ticks > 0 or 0.0 < self._readings_per_tick < 1.0
        self._current: Reading | None = None
        self._current_tick = 0  # the tick in which `_current` was measured
        self._delayed: deque[tuple[int, Reading]] = deque()  # readings, each with the tick in which it becomes current

    def read(self, tick: int) -> dict[str, FloatArray]:
        """Return fields "sensor.field" -> (rows,) or (rows, width), a row per robot of the group, arena by arena."""
        if self._samples:
            self._sample(tick)
            values = tuple(value.copy() for value in self._current) if self._current else self._blank()
        else:
            values = self._measure(tick)
        if self.failed is not None:
            for value, field in zip(values, self._fields, strict=True):
                value[self.failed] = field.blank
        return {key: value.reshape(shape) for (key, shape), value in zip(self._columns, values, strict=True)}

    def follow(self, tick: int) -> None:
        """Update the sensor in a tick in which the group does not act."""
        if self._samples:
            self._sample(tick)
        else:
            self._sensor.follow(tick)

    def age(self, tick: int) -> int | None:
        """Return the number of ticks since the reading of this tick was measured, after `read` or `follow`.

        None: no reading yet.
        """
        if not self._samples:
            return 0
        return None if self._current is None else tick - self._current_tick

    def _measure(self, tick: int) -> Reading:
        truth = self._sensor.truth(tick)
        values = (truth,) if isinstance(truth, np.ndarray) else tuple(truth)
        for value, stages in zip(values, self._stages, strict=True):
            stages.apply(value, self._keys, self._group.start, tick, self._running)
        return values

    def _sample(self, tick: int) -> None:
        """Measure if a reading is due, and make the newest reading that is old enough current."""
        if self._is_due(tick):
            self._delayed.append((tick + self._delay_ticks, self._measure(tick)))
        else:
            self._sensor.follow(tick)
        while self._delayed and self._delayed[0][0] <= tick:
            due_tick, self._current = self._delayed.popleft()
            self._current_tick = due_tick - self._delay_ticks

    def _blank(self) -> Reading:
        shape = len(self._keys), self._group.stop - self._group.start
        return tuple(np.full((*shape, field.width) if field.width else shape, field.blank) for field in self._fields)

    def _is_due(self, tick: int) -> bool:
        per_tick = self._readings_per_tick
        if not 0.0 < per_tick < 1.0 or tick == 0:
            return True
        return floor(tick * per_tick + ROUNDING) > floor((tick - 1) * per_tick + ROUNDING)
