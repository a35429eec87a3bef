"""Whoever waits for the compiler is told so, once, and nobody else."""

from io import StringIO

from numba import njit
from rich.console import Console

from swarmwire.deploy.compiling import TOLD, compiling_told


def add(a, b):
    return a + b


def test_what_is_compiled_is_told_once_and_what_is_compiled_already_is_not():
    out = StringIO()
    console = Console(file=out, width=200)
    one, other = njit(add), njit(add)
    with compiling_told(console):
        one(1, 2)
        one(1.0, 2.0)
    assert out.getvalue() == f"{TOLD}\n"
    with compiling_told(console):
        one(3, 4)
    assert out.getvalue() == f"{TOLD}\n"
    other(1, 2)  # afterwards
    assert out.getvalue() == f"{TOLD}\n"
