"""A pytest plugin: kernels as plain Python, since coverage sees nothing of compiled code.

What numba does otherwise than Python is made up for, so that kernels compute the same: fields of records are
attributes, integers that run over wrap, and divisions by zero give infinities without a warning. The elementary
functions stay compiled, since an exp or log would be thirty calls; their formulas are those of Python's floats, too.
Tests that would take minutes are left, with their reason, once they have called kernels often; all of them run with the
compiler, too.
"""

import functools
import threading
from collections.abc import Callable
from operator import itemgetter
from typing import Any

import numba
import numpy as np
import pytest

MAX_CALLS = 250_000  # in one test: some seconds
COMPILED = "swarmwire.comms.base.math"


class _Within(threading.local):
    kernel = False


class _Calls:
    in_this_test = 0


_within = _Within()
_numba_njit: Any = numba.njit


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Callable[..., Any]:
    """What stands in for numba's: the function itself, given what a compiled one would be given."""
    decorate = functools.partial(_plain, **options)
    return decorate if function is None else decorate(function)


def _plain(function: Callable[..., Any], **options: Any) -> Callable[..., Any]:
    if function.__module__.startswith(COMPILED):
        return _numba_njit(**options)(function)

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
        return value.view(_record_dtype(value.dtype)) if value.dtype.names else value
    if isinstance(value, tuple):
        parts = map(_with_records, value)
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return value


@functools.cache
def _record_dtype(dtype: np.dtype[np.void]) -> np.dtype[np.void]:
    """The dtype, with elements that have their fields as attributes: numpy's own records take four times as long."""
    assert dtype.names is not None
    fields = {name: property(itemgetter(name), functools.partial(_set_field, name)) for name in dtype.names}
    return np.dtype((type("Record", (np.void,), fields), dtype))


def _set_field(name: str, record: np.void, value: Any) -> None:
    record[name] = value


def pytest_runtest_setup() -> None:
    """Each test has its own number of calls."""
    _Calls.in_this_test = 0


numba.njit = njit  # before anything that has kernels is imported
