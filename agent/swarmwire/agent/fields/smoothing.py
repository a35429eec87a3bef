"""What keeps a command from flickering: a low-pass and a hysteresis, per robot."""

from swarmwire.comms.arrays import BoolArray, FloatArray


def low_pass(before: FloatArray, wanted: FloatArray, period_s: float, time_constant_s: float) -> FloatArray:
    """What `before` (n,) has become a period later on its way to `wanted` (n,), in their unit.

        y <- y + (u - y) T / (tau + T)

    the first-order lag tau dy/dt = u - y by the backward Euler rule, so that no tau is too short for the period: with
    tau = 0 it is at once what is wanted.
    """
    return before + (wanted - before) * (period_s / (time_constant_s + period_s))


def hysteresis(on: BoolArray, value: FloatArray, rises_to: float, falls_to: float) -> BoolArray:
    """Whether each is on, (n,): goes on at `rises_to` or more, off at `falls_to` or less, stays as it was in between.

    Schmitt's trigger, with `falls_to` below `rises_to`, all in the unit of `value` (n,); nan changes nothing.
    """
    return (on | (value >= rises_to)) & ~(value <= falls_to)
