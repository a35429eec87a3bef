"""A sense as its group reads it: the truth at its rate, through the stages, and shown after its delay."""

from collections import deque
from math import ceil, floor

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, KeyArray
from swarmwire.comms.bodies.sensors import RangedSheet, Sheet
from swarmwire.comms.truth import Group
from swarmwire.world.sensors.sensor import Following, TrueSense
from swarmwire.world.sensors.stages import Stages

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
        sense: TrueSense,
        sheet: Sheet,
        keys: KeyArray,
        group: Group,
        tick_s: float,
        running: BoolArray | None = None,
    ) -> None:
        """The sense `name` of a group in the arenas of these keys (arenas,).

        Nobody reads it in arenas that are not `running` (arenas,), which may change; None: all always are.
        """
        self.failed: BoolArray | None = None
        self._sense, self._keys, self._running, self._group = sense, keys, running, group
        outlier = sheet.outlier if isinstance(sheet, RangedSheet) else 0.0
        self._stages = [Stages(name, field, outlier, sheet.drop_out) for field in sense.fields]
        self._fields = [(f"{name}.{field.name}", (-1, field.width) if field.width else -1) for field in sense.fields]
        self._per_tick = sheet.rate_hz * tick_s  # readings; 0: one in each tick
        self._delay = ceil(sheet.delay_s / tick_s - NEAR)  # ticks
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
            for value, field in zip(values, self._sense.fields, strict=True):
                value[self.failed] = field.blank
        return {key: value.reshape(shape) for (key, shape), value in zip(self._fields, values, strict=True)}

    def follow(self, tick: int) -> None:
        """Keep up in a tick in which the group does not act."""
        if self._held:
            self._hold(tick)
        elif isinstance(self._sense, Following):
            self._sense.follow(tick)

    def _take(self, tick: int) -> Taken:
        values = self._sense.truth(tick)
        for value, stages in zip(values, self._stages, strict=True):
            stages.apply(value, self._keys, self._group.start, tick, self._running)
        return values

    def _hold(self, tick: int) -> None:
        """Take a reading if one is due, and show the newest that is old enough."""
        if self._is_due(tick):
            self._waiting.append((tick + self._delay, self._take(tick)))
        elif isinstance(self._sense, Following):
            self._sense.follow(tick)
        while self._waiting and self._waiting[0][0] <= tick:
            self._shown = self._waiting.popleft()[1]

    def _blank(self) -> Taken:
        shape = len(self._keys), self._group.stop - self._group.start
        return tuple(
            np.full((*shape, field.width) if field.width else shape, field.blank) for field in self._sense.fields
        )

    def _is_due(self, tick: int) -> bool:
        per_tick = self._per_tick
        if not 0.0 < per_tick < 1.0 or tick == 0:
            return True
        return floor(tick * per_tick + NEAR) > floor((tick - 1) * per_tick + NEAR)
