"""Elementary functions: equal bits for floats, arrays and compiled code, and the error against many digits."""

import math as libm
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base import math
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.math import ARRAYS, BINARY, FLOATS, UNARY, compiled

NEAREST = 6381956970095103 * 2.0**797  # to a multiple of pi / 2 of all doubles (Muller, Elementary Functions, 2016)
EDGES = np.array(
    [
        *(0.0, -0.0, 1.0, -1.0, 0.5, -0.5, np.inf, -np.inf, np.nan, 5e-324, -5e-324, 2.0**-1022, -(2.0**-1022)),
        *(1.7976931348623157e308, -1.7976931348623157e308, 709.782712893384, 709.7827128933841, -745.14, -708.4),
        *(np.pi, np.pi / 2, np.pi / 4, 3 * np.pi / 4, 1e6, np.nextafter(1e6, 2e6), 1e22, NEAREST),
        *(0.25, 0.84375, 1.25, 2.857142857142857, 28.0, 0.4375, 0.6875, 1.1875, 2.4375, 0.975, 2.0**0.5, 0.5**0.5),
    ]
)
# Range of the arguments, and the error that is allowed, in units in the last place
RANGES = {
    "sin": ((-100.0, 100.0), 1.0),
    "cos": ((-100.0, 100.0), 1.0),
    "tan": ((-100.0, 100.0), 2.0),
    "atan": ((-20.0, 20.0), 1.0),
    "asin": ((-1.0, 1.0), 1.0),
    "exp": ((-700.0, 700.0), 1.0),
    "expm1": ((-40.0, 40.0), 1.0),
    "log": ((1e-300, 1e3), 1.0),
    "log1p": ((-0.999, 10.0), 1.0),
    "log10": ((1e-300, 1e3), 2.0),
    "log2": ((1e-300, 1e3), 1.0),
    "erfc": ((-6.0, 26.0), 2.0),
}


def bits(values: FloatArray) -> list[int]:
    """The bits of each value; all that are not a number count as one."""
    return np.where(np.isnan(values), np.nan, values).view(np.int64).tolist()


def by_kernel(name: str, *arguments: FloatArray) -> FloatArray:
    out = np.empty(len(arguments[0]))
    math.COMPILED[name](*arguments, out)
    return out


def by_floats(name: str, *arguments: FloatArray) -> FloatArray:
    function: Callable[..., float] = FLOATS.named(name)
    return np.array([function(*values) for values in zip(*(a.tolist() for a in arguments), strict=True)], np.float64)


def assert_equal_bits(name: str, *arguments: FloatArray) -> None:
    expected = bits(ARRAYS.named(name)(*arguments))
    assert bits(by_floats(name, *arguments)) == expected
    assert bits(by_kernel(name, *arguments)) == expected


@pytest.mark.parametrize("name", UNARY)
def test_math_of_one_number_is_equal_for_floats_arrays_and_kernels(name: str) -> None:
    rng = np.random.default_rng(1)
    sign = rng.choice([-1.0, 1.0], 2000)
    assert_equal_bits(
        name, np.concatenate([EDGES, sign * 10.0 ** rng.uniform(-320, 308, 2000), rng.uniform(-8, 8, 2000)])
    )


@pytest.mark.parametrize("name", BINARY)
def test_math_of_two_numbers_is_equal_for_floats_arrays_and_kernels(name: str) -> None:
    rng = np.random.default_rng(2)
    x, y = (rng.choice([-1.0, 1.0], 2000) * 10.0 ** rng.uniform(-30, 30, 2000) for _ in range(2))
    grid = np.repeat(EDGES, len(EDGES)), np.tile(EDGES, len(EDGES))
    near = rng.uniform(0.5, 2.0, 2000), rng.uniform(-900.0, 900.0, 2000)
    assert_equal_bits(name, *(np.concatenate(parts) for parts in zip(grid, (x, y), near, strict=True)))


@given(st.sampled_from(UNARY), st.lists(st.floats(width=64), min_size=1, max_size=40))
def test_math_of_any_number_is_equal_for_floats_arrays_and_kernels(name: str, values: list[float]) -> None:
    assert_equal_bits(name, np.array(values))


def errors_in_ulp(name: str, x: FloatArray, *more: FloatArray) -> FloatArray:
    """The distance of each result from the exact one, in units in the last place of the exact one."""
    reference = {"log2": lambda x: mpmath.log(x, 2), "atan2": mpmath.atan2}.get(name) or getattr(mpmath, name)
    results = ARRAYS.named(name)(x, *more)
    with mpmath.workprec(200):
        exact = [
            reference(*map(mpmath.mpf, values)) for values in zip(x.tolist(), *(m.tolist() for m in more), strict=True)
        ]
        return np.array(
            [
                float(abs(mpmath.mpf(result) - value) / float(np.spacing(abs(float(value)))))
                for result, value in zip(results.tolist(), exact, strict=True)
            ]
        )


@pytest.mark.parametrize("name", UNARY)
def test_math_of_one_number_is_within_its_error(name: str) -> None:
    (low, high), allowed = RANGES[name]
    rng = np.random.default_rng(3)
    x = rng.uniform(low, high, 1500) if low != 1e-300 else 10.0 ** rng.uniform(-300, 3, 1500)
    assert errors_in_ulp(name, x).max() <= allowed


def test_math_of_huge_angles_is_within_one_unit() -> None:
    x = np.concatenate([10.0 ** np.random.default_rng(4).uniform(6, 308, 500), [NEAREST, 1e22]])
    assert errors_in_ulp("sin", x).max() <= 1.0
    assert errors_in_ulp("cos", x).max() <= 1.0


@pytest.mark.parametrize(("name", "allowed"), [("atan2", 2.0), ("power", 1.0), ("hypot", 1.5)])
def test_math_of_two_numbers_is_within_its_error(name: str, allowed: float) -> None:
    rng = np.random.default_rng(5)
    x, y = rng.uniform(0.01, 20.0, 1500), rng.uniform(-60.0, 60.0, 1500)
    assert errors_in_ulp(name, x, y).max() <= allowed


def test_math_edges_are_those_of_the_c_library() -> None:
    for y in (0.0, -0.0, 1.0, -1.0, np.inf, -np.inf):
        for x in (0.0, -0.0, 1.0, -1.0, np.inf, -np.inf):
            assert libm.copysign(1.0, math.atan2(y, x)) == libm.copysign(1.0, libm.atan2(y, x))
            assert math.atan2(y, x) == pytest.approx(libm.atan2(y, x), abs=1e-15)
    assert (math.exp(np.inf), math.exp(-np.inf), math.log(0.0), math.log1p(-1.0)) == (np.inf, 0.0, -np.inf, -np.inf)
    assert all(np.isnan([math.sin(np.inf), math.log(-1.0), math.asin(1.5), math.power(-2.0, 0.5), math.cos(np.nan)]))
    assert (math.power(2.0, 10.0), math.power(0.0, -1.0), math.power(5.0, 0.0)) == (1024.0, np.inf, 1.0)
    assert libm.copysign(1.0, math.sin(-0.0)) == -1.0


def test_math_of_an_array_keeps_its_shape_and_of_a_number_its_kind() -> None:
    assert math.sin(np.zeros((2, 3))).shape == (2, 3)
    assert math.atan2(np.ones((2, 1)), np.ones(3)).shape == (2, 3)
    assert type(math.sin(0.5)) is float
    assert compiled.sin(0.5) == math.sin(0.5)
    assert type(math.sin(np.array(0.5))) is float
