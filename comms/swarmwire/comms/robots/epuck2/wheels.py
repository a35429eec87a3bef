"""How fast the e-puck2 goes: steps of its wheels, and the speeds of its body."""

from math import pi

STEPS_PER_TURN = 1000
M_PER_STEP = pi * 0.04 / STEPS_PER_TURN  # wheels of 40 mm
FASTEST = 1100  # steps/s; the firmware goes no faster, whatever it is told


def wheel_steps(linear_mps: float, angular_radps: float, wheel_base_m: float) -> tuple[int, int]:
    """Steps/s of the left and the right wheel, slowed down together where one would be too fast, so the curve stays.

    >>> wheel_steps(0.1, 0.0, 0.053), wheel_steps(0.0, 1.0, 0.053), wheel_steps(0.1, 50.0, 0.053)
    ((796, 796), (-211, 211), (-946, 1100))
    """
    apart_mps = 0.5 * wheel_base_m * angular_radps
    left, right = (linear_mps - apart_mps) / M_PER_STEP, (linear_mps + apart_mps) / M_PER_STEP
    slower = min(1.0, FASTEST / max(abs(left), abs(right), 1.0))
    return round(left * slower), round(right * slower)


def body_speeds(left: int, right: int, wheel_base_m: float) -> tuple[float, float]:
    """How fast in m/s, and turning how fast to the left in rad/s, the robot goes at these steps/s.

    Each wheel goes no faster than the firmware lets it.
    """
    left, right = (max(-FASTEST, min(FASTEST, steps)) for steps in (left, right))
    return 0.5 * (left + right) * M_PER_STEP, (right - left) * M_PER_STEP / wheel_base_m
