"""A long wait for the compiler is told, once."""

from io import StringIO

from numba import njit
from rich.console import Console

from swarmwire.deploy.host import COMPILING, compiling_told


def add(a, b):
    return a + b


def test_what_is_compiled_is_told_once_and_what_is_compiled_already_is_not():
    out = StringIO()
    console = Console(file=out, width=200)
    one, other = njit(add), njit(add)
    with compiling_told(console, after_s=0.001):
        one(1, 2)
        one(1.0, 2.0)
    assert out.getvalue() == f"{COMPILING}\n"
    with compiling_told(console, after_s=0.001):
        one(3, 4)
    assert out.getvalue() == f"{COMPILING}\n"
    other(1, 2)  # afterwards
    assert out.getvalue() == f"{COMPILING}\n"


def test_what_is_compiled_in_a_moment_is_not_told():
    out = StringIO()
    with compiling_told(Console(file=out), after_s=1000.0):
        njit(add)(1, 2)
    assert out.getvalue() == ""
