"""Compiled functions: the two ways to make them, and a cache on disk that notices every change.

- `njit`: numba's, cached. What compiled code calls is compiled for that alone, without the way in from Python.
- `kernel`: for functions that allocate nothing and are called a million times a second. By default compiled code counts
  a reference each time that it takes an array out of a tuple of arrays; where small functions pass such tuples on, that
  is four fifths of the time. A kernel counts none, since its caller holds all arrays until it returns (numba compiles
  parts of itself in this way), and is inlined, so that tuples are not copied from one to the next.

numba's own cache looks at the file of a compiled function alone: after a change of a constant or of a function that
it uses from elsewhere, machine code from before would run on. Here the cache also compares what a function uses
(`digest_of`) and the fields of the tuples that it is given.

This is the only module that imports numba. It relies on private parts of numba: `_nrt`, `_cache`, `_cache_file`,
`_cache_path`, `_source_stamp`, `_index_key`, `_compile_for_args`, `get_call_template`, `get_overload`, `_values`,
`_lock`, `ensure_blas`, `raise_with_shape_context`. So pyproject.toml pins numba's minor version, and
`tests/unit/comms/base/test_draws.py` fails when one of them is not as it was.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false, reportUnknownVariableType=false

from __future__ import annotations

import atexit
import fcntl
import gc
import hashlib
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from enum import Enum
from functools import cache, partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NoReturn, TypeVar, cast

import numba
import numpy as np
from llvmlite.binding import ffi
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher
from numba.core.targetconfig import TargetConfig
from numba.core.types import BaseNamedTuple, unliteral
from numba.extending import overload
from numba.np import arrayobj, linalg

F = TypeVar("F", bound=Callable[..., Any])

FOREIGN = {"numpy", "numba", *sys.stdlib_module_names}  # modules whose functions numba knows by itself
PLAIN = bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype


def _load_arrays_without_scipy() -> None:
    """Load numba's array functions without scipy.linalg, which takes 0.2 s and is imported to see that it is there.

    Linear algebra in a compiled function still imports it.
    """
    if find_spec("scipy") is None:
        return
    imported = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = imported


_load_arrays_without_scipy()


def _compile_faster() -> None:
    """Spare numba work that is more than a tenth of the time to compile.

    It compares all options of a function for each operation in it, and times each call of LLVM by callbacks, for
    reports that nothing here reads. With the first assignment of a slice it compiles texts, number by number, for an
    error that names the shapes; here the error does not.
    """

    @cache
    def defaults(kind: Any) -> dict[str, Any]:
        return {name: option.default for name, option in kind.options.items()}

    def values(self: Any) -> dict[str, Any]:
        return {**defaults(type(self)), **self._values}

    TargetConfig.values = values
    lib: Any = ffi.lib
    lib._lock._cblist.clear()

    def other_shape(source: Any, target: Any) -> NoReturn:  # noqa: ARG001 - numba matches the parameters of both
        raise ValueError("expected an array of the size of the slice that it is assigned to")

    @overload(other_shape)
    def _(source: Any, target: Any) -> Callable[..., NoReturn]:  # noqa: ARG001 - numba matches the parameters of both
        return other_shape

    arrayobj.raise_with_shape_context = other_shape


_compile_faster()
atexit.register(gc.freeze)  # else Python looks for garbage among numba's objects before it ends, for a second


def njit(*, cache: bool = True, **options: Any) -> Callable[[F], F]:
    """`numba.njit` with options of its own; cached on disk by default."""
    # Without the way in from C code, which nothing takes: it is 7 % of the time to compile.
    options["no_cfunc_wrapper"] = True
    uncallable: dict[str, Any] = {"no_cpython_wrapper": True}

    def compiled(function: F) -> F:
        made: Any = numba.njit(**options)(function)
        if isinstance(made, Dispatcher):  # without the compiler numba returns the function itself
            called: Any = _for_kernels(numba.njit(**options, **uncallable)(function))
            made._compile_for_args = partial(_compile_for_args, made)
            _call(made, called)
            if cache:
                made._cache, called._cache = _Cache(function), _Cache(function, is_called=True)
        return cast("F", made)

    return compiled


def kernel(*, from_python: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A kernel that allocates nothing; unless it is called `from_python`, other kernels alone can call it."""
    uncounted: dict[str, Any] = {"_nrt": False, "forceinline": True}

    def compiled(function: Callable[..., Any]) -> Any:
        made: Any = njit(**uncounted, **options)(function)
        return made if from_python else _for_kernels(made)

    return compiled


def _compile_for_args(made: Any, *args: Any, **kws: Any) -> Any:
    """As numba's, without looking for garbage meanwhile: numba's many objects make that a tenth of the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        return Dispatcher._compile_for_args(made, *args, **kws)
    finally:
        if was_enabled:
            gc.enable()


def _call(made: Any, called: Any) -> None:
    """Have compiled code call `called` in place of `made`, the same function.

    The way in from Python unpacks every array of every tuple: for a small function that takes longer to compile than
    the function itself. Constant arguments count as numbers: numba would compile the function for each constant.
    """

    def template(args: Any, kws: Any) -> Any:
        _, given = made._compiler.fold_argument_types(args, kws)
        given = tuple(unliteral(kind) for kind in given)
        return Dispatcher.get_call_template(made if given in made.overloads else called, given, {})

    def overload(args: Any) -> Any:
        return Dispatcher.get_overload(called if tuple(args) in called.overloads else made, args)

    made.get_call_template, made.get_overload = template, overload


def _for_kernels(made: Any) -> Any:
    """The function, which raises TypeError if Python calls it: numba would call what is not there, and crash."""

    def keep(compiled: Any) -> None:  # for other kernels; numba would also list it among what Python may call
        made.overloads[tuple(compiled.signature.args)] = compiled

    def refuse(*_: Any, **__: Any) -> NoReturn:
        raise TypeError(f"{made.__name__}: expected a call by another kernel, or from_python=True where it is defined")

    made.add_overload, made._compile_for_args = keep, refuse
    return made


class _Cache(FunctionCache):
    """The cache of one compiled function; what it holds is dropped once anything that the function uses has changed."""

    _is_stamped = False

    def __init__(self, function: Callable[..., Any], *, is_called: bool = False) -> None:
        """`is_called`: by compiled code, without the way in from Python."""
        super().__init__(function)
        self._is_called = is_called

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature; None if there is none, or none that is up to date."""
        self._stamp()
        with self._locked():
            try:
                return super().load_overload(sig, target_context)
            except (AttributeError, ImportError):  # it names a class that was renamed or moved
                self.flush()
                return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the machine code of a signature."""
        self._stamp()
        with self._locked():
            super().save_overload(sig, data)

    @contextmanager
    def _locked(self) -> Generator[None]:
        """Keep other processes out of the folder.

        numba writes the index before the code that it names: another process would run the code of an earlier version
        that still has this name, or that of another signature.
        """
        folder = Path(self._cache_path)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock = (folder / "kernels.lock").open("ab")
        except OSError:  # nothing can be kept there
            yield
            return
        with lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            yield

    def _stamp(self) -> None:
        """Take what the function uses into the stamp: only now, since all of its module is there when it is called."""
        if not self._is_stamped:
            self._is_stamped = True
            file: Any = self._cache_file
            file._source_stamp = file._source_stamp, digest_of(self._py_func)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return super()._index_key(sig, codegen), tuple(_tuple_fields(kind) for kind in sig), self._is_called


def _tuple_fields(kind: Any) -> Any:
    """The names of a named tuple's fields, nested ones as well: machine code knows them by their places."""
    if issubclass(type(kind), BaseNamedTuple):
        return kind.fields, tuple(_tuple_fields(of) for of in kind.types)
    return None


def digest_of(function: Callable[..., Any]) -> str:
    """SHA-256 over a function's code, and over the constants and compiled functions that it uses, theirs included."""
    found, waiting = dict[Any, bytes](), [function]
    while waiting:
        if (of := waiting.pop()) not in found:
            found[of], used = _own(of)
            waiting += used
    return hashlib.sha256(b"".join(found.values())).hexdigest()


@cache
def _own(function: Any) -> tuple[bytes, tuple[Any, ...]]:
    """The digest of a function's own code and constants, and the functions that are behind what it calls."""
    digest, used = hashlib.sha256(), list[Any]()

    def add_code(code: CodeType) -> None:
        digest.update(code.co_code + repr((code.co_names, code.co_varnames)).encode())
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                add_code(constant)
            else:
                digest.update(repr(constant).encode())

    def add_value(name: str, value: Any) -> None:
        if isinstance(value, Dispatcher):
            digest.update(name.encode())
            used.append(value.py_func)
        elif isinstance(value, ModuleType):
            if value.__name__.partition(".")[0] not in FOREIGN:
                for attribute in names:
                    if attribute in vars(value):
                        add_value(f"{name}.{attribute}", vars(value)[attribute])
        elif isinstance(value, type):
            members = [member.value for member in value] if issubclass(value, Enum) else []
            digest.update(repr((name, getattr(value, "_fields", ()), members)).encode())
        elif isinstance(value, np.ndarray):
            digest.update(repr((name, value.dtype.descr, value.shape)).encode() + value.tobytes())
        elif isinstance(value, tuple):
            digest.update(repr((name, type(value).__name__, len(value))).encode())
            for place, item in enumerate(value):
                add_value(str(place), item)
        elif isinstance(value, PLAIN):
            digest.update(repr((name, value)).encode())

    names = _names_in(function.__code__)
    add_code(function.__code__)
    for name in names:
        if name in function.__globals__:
            add_value(name, function.__globals__[name])
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        add_value(name, cell.cell_contents)
    return digest.digest(), tuple(used)


def _names_in(code: CodeType) -> tuple[str, ...]:
    """The names that a function reads, nested ones as well, each once."""
    nested = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return tuple(dict.fromkeys([*code.co_names, *(name for inner in nested for name in _names_in(inner))]))
