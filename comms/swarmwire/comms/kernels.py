"""How kernels that only borrow their arrays are compiled: without counting references.

By default compiled code counts a reference each time that it takes an array out of a tuple of arrays; where small
functions pass such tuples on a million times a second, that is four fifths of the time. Kernels compiled by this
allocate nothing, and their caller holds all the arrays until they return. (numba compiles parts of itself in this way.)
They are inlined into one another, so that tuples are not copied from one to the next.

Only those that Python calls have a way in from there: it unpacks every array of every tuple, and for a small function
that takes longer to compile than the function itself.
"""

from collections.abc import Callable
from typing import Any, NoReturn

from numba import njit


def kernel(*, from_python: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """`numba.njit` for kernels that allocate nothing; what is not called `from_python` other kernels alone can call."""
    uncounted: dict[str, Any] = {"cache": True, "_nrt": False, "forceinline": True}
    ways_in: dict[str, Any] = {"no_cfunc_wrapper": True, "no_cpython_wrapper": not from_python}

    def compiled(function: Callable[..., Any]) -> Any:
        kernel: Any = njit(**uncounted, **ways_in, **options)(function)
        return kernel if from_python else _for_kernels(kernel)

    return compiled


def _for_kernels(kernel: Any) -> Any:
    """The kernel, which raises TypeError if Python calls it: numba would call what is not there, and crash."""

    def keep(compiled: Any) -> None:  # for other kernels; numba would also list it among what Python may call
        kernel.overloads[tuple(compiled.signature.args)] = compiled

    def refuse(*_: Any, **__: Any) -> NoReturn:
        raise TypeError(
            f"{kernel.__name__}: expected a call by another kernel, or from_python=True where it is defined"
        )

    kernel.add_overload, kernel._compile_for_args = keep, refuse
    return kernel
