"""A pytest plugin: kernels as plain Python, since coverage sees nothing of compiled code.

What numba does otherwise than Python is made up for, so that kernels compute the same: fields of records are
attributes, integers that run over wrap, and divisions by zero give infinities without a warning. Tests that would take
minutes are left, with their reason, once they have called kernels often; all of them run with the compiler, too.
"""

import functools
import threading
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
import pytest

MAX_CALLS = 2_500_000  # in one test: some ten seconds; one exp or log is thirty of them


class _Within(threading.local):
    kernel = False


class _Calls:
    in_this_test = 0


_within = _Within()


def njit(function: Callable[..., Any] | None = None, **_: Any) -> Callable[..., Any]:
    """What stands in for numba's: the function itself, given what a compiled one would be given."""
    return _plain if function is None else _plain(function)


def _plain(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def kernel(*args: Any) -> Any:
        _count()
        if _within.kernel:
            return function(*args)
        _within.kernel = True
        try:
            with np.errstate(all="ignore"):
                return function(*map(_with_records, args))
        finally:
            _within.kernel = False

    return kernel


def _count() -> None:
    _Calls.in_this_test += 1
    if _Calls.in_this_test > MAX_CALLS:
        pytest.skip(f"needs the compiler: it calls kernels more than {MAX_CALLS} times")


def _with_records(value: Any) -> Any:
    """The value, with the fields of records as attributes, also in tuples."""
    if isinstance(value, np.ndarray):
        return value.view(np.recarray) if value.dtype.names else value
    if isinstance(value, tuple):
        parts = map(_with_records, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


def pytest_runtest_setup() -> None:
    """Each test has its own number of calls."""
    _Calls.in_this_test = 0


numba.njit = njit  # before anything that has kernels is imported
