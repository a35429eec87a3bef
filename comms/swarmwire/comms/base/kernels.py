"""Compiled functions: two decorators, and a cache on disk that notices every change.

- `njit`: numba's, cached. Compiled code calls a second version of the function, without the CPython wrapper.
- `kernel`: for functions that allocate nothing and are called a million times a second. numba increments a reference
  count (NRT) whenever an array is taken from a tuple; where small functions pass such tuples on, that is four fifths of
  the time. `kernel` switches this off, which is safe because the caller holds the arrays until the kernel returns
  (numba compiles parts of itself in this way), and inlines the function, so that tuples are not copied.

The word kernel stands for functions with the second decorator; all others with either one are compiled functions.

numba's own cache compares only the file of a compiled function: after a change of a constant or of a function that it
uses from elsewhere, earlier machine code would run on. Here the cache also compares everything that a function uses
(`digest_of`) and the fields of the named tuples among its arguments. Where the machine code for this very CPU is not
cached, that for `PORTABLE_CPU` is used if it is: it comes from an image or another machine (`kernel_archive.py`).

This module and `kernel_archive.py` alone import numba. It changes the functions that it compiles, and nothing of numba
itself: `numba.njit` in a user's code works as documented. It relies on PRIVATE_NAMES, so numba's minor version is
pinned.
"""

# pyright: reportUnknownMemberType=false, reportUnknownArgumentType=false, reportUnknownVariableType=false

from __future__ import annotations

import fcntl
import gc
import hashlib
import platform
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from enum import Enum
from functools import cache, partial
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, NoReturn, TypeVar, cast

import numba
import numpy as np
from numba.core import config, event
from numba.core.caching import FunctionCache
from numba.core.codegen import get_host_cpu_features
from numba.core.dispatcher import Dispatcher
from numba.core.types import BaseNamedTuple, unliteral

F = TypeVar("F", bound=Callable[..., Any])

# What numba does not document and this module uses: attributes of its classes, and options of `numba.njit`.
PRIVATE_NAMES = {
    "Dispatcher": (
        *("_cache", "_compile_for_args", "_compiler", "add_overload"),
        *("get_call_template", "get_overload", "overloads", "py_func", "targetoptions"),
    ),
    "FunctionCache": (*("_cache_path", "_index_key", "_py_func", "flush", "load_overload", "save_overload"),),
    "IndexDataCacheFile": ("_load_data", "_load_index", "save"),  # in kernel_archive.py
    "BaseNamedTuple": ("fields", "types"),
    "options": ("_nrt", "forceinline", "no_cfunc_wrapper", "no_cpython_wrapper"),
}

# The CPU of machine code that other machines can use, as LLVM names it, by machine type: with AVX2, FMA and BMI2 on
# x86-64, as all server processors since 2015 have. Results are the same bits for every CPU.
PORTABLE_CPUS = {"x86_64": "x86-64-v3", "aarch64": "generic"}
PORTABLE_CPU = PORTABLE_CPUS.get(platform.machine(), "generic")
X86_64_V3 = ("avx", "avx2", "bmi", "bmi2", "cx16", "f16c", "fma", "lzcnt", "movbe", "popcnt", "sse4.2")

COMPILE_EVENT = "numba:compile"  # numba does not raise it for a function that its cache has
FOREIGN = {"numpy", "numba", *sys.stdlib_module_names}  # modules whose functions numba compiles by itself
PLAIN = bool, int, float, complex, str, bytes, type(None), np.generic, np.dtype


def njit(*, cache: bool = True, **options: Any) -> Callable[[F], F]:
    """Return a decorator that compiles as `numba.njit` does; machine code is cached on disk by default."""
    # No C wrapper: nothing uses it, and it costs 7 % of the compile time.
    options["no_cfunc_wrapper"] = True
    without_wrapper: dict[str, Any] = {"no_cpython_wrapper": True}

    def decorate(function: F) -> F:
        compiled: Any = numba.njit(**options)(function)
        if isinstance(compiled, Dispatcher):  # numba returns the function itself if its compiler is disabled
            inner: Any = _refuse_python(numba.njit(**options, **without_wrapper)(function))
            compiled._compile_for_args = partial(_compile_for_args, compiled)
            _redirect_calls(compiled, inner)
            if cache:
                compiled._cache = _Cache(function, options)
                inner._cache = _Cache(function, options, is_inner=True)
        return cast("F", compiled)

    return decorate


def kernel(*, from_python: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator for a function that allocates nothing; only with `from_python` can Python call it."""
    without_refcounts: dict[str, Any] = {"_nrt": False, "forceinline": True}

    def decorate(function: Callable[..., Any]) -> Any:
        compiled: Any = njit(**without_refcounts, **options)(function)
        return compiled if from_python else _refuse_python(compiled)

    return decorate


@contextmanager
def compile_events(on_start: Callable[[int], None], on_end: Callable[[int], None]) -> Generator[None]:
    """Within the context, call `on_start` before a function is compiled, and `on_end` after it.

    Their argument is the number of functions that are being compiled and call this one: 0 for the outermost. Functions
    whose machine code is cached raise no event. numba compiles in one thread at a time.
    """
    with event.install_listener(COMPILE_EVENT, _CompileListener(on_start, on_end)):
        yield


class _CompileListener(event.Listener):
    def __init__(self, on_start: Callable[[int], None], on_end: Callable[[int], None]) -> None:
        self._on_start, self._on_end, self._depth = on_start, on_end, 0

    def on_start(self, event: event.Event) -> None:
        self._depth += 1
        self._on_start(self._depth - 1)

    def on_end(self, event: event.Event) -> None:
        self._depth -= 1
        self._on_end(self._depth)


def _compile_for_args(compiled: Any, *args: Any, **kws: Any) -> Any:
    """Compile as numba does, without garbage collection: numba's many objects make that a tenth of the time."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        return Dispatcher._compile_for_args(compiled, *args, **kws)
    finally:
        if was_enabled:
            gc.enable()


def _redirect_calls(compiled: Any, inner: Any) -> None:
    """Have compiled code call `inner` in place of `compiled`, the same function.

    The CPython wrapper unpacks every array of every tuple: for a small function that takes longer to compile than the
    function itself. Literal arguments are typed as plain numbers: numba would compile the function for each literal.
    """

    def template(args: Any, kws: Any) -> Any:
        _, folded = compiled._compiler.fold_argument_types(args, kws)
        kinds = tuple(unliteral(kind) for kind in folded)
        return Dispatcher.get_call_template(compiled if kinds in compiled.overloads else inner, kinds, {})

    def overload(args: Any) -> Any:
        return Dispatcher.get_overload(inner if tuple(args) in inner.overloads else compiled, args)

    compiled.get_call_template, compiled.get_overload = template, overload


def _refuse_python(compiled: Any) -> Any:
    """Return the function; a call from Python raises TypeError, where numba would call a null pointer, and crash."""

    def add(result: Any) -> None:  # numba would also add it to the overloads that Python may call
        compiled.overloads[tuple(result.signature.args)] = result

    def refuse(*_: Any, **__: Any) -> NoReturn:
        name = compiled.__name__
        raise TypeError(f"{name}: expected a call by another kernel, or from_python=True where it is defined")

    compiled.add_overload, compiled._compile_for_args = add, refuse
    return compiled


class _Cache(FunctionCache):
    """The cache of one compiled function; its entries are not used once anything that the function uses has changed."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any], *, is_inner: bool = False) -> None:
        """`is_inner`: the version that compiled code calls, without the CPython wrapper."""
        super().__init__(function)
        self._options, self._is_inner = options, is_inner
        self._is_portable = False  # whether the present search is for the portable CPU's machine code

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the machine code for a signature; None if there is none that is up to date."""
        with locked(Path(self._cache_path)):
            try:
                loaded = super().load_overload(sig, target_context)
                if loaded is None and self._portable_exists():
                    self._is_portable = True
                    loaded = super().load_overload(sig, target_context)
            except (AttributeError, ImportError):  # the entry names a class that was renamed or moved
                self.flush()
                return None
            finally:
                self._is_portable = False
            return loaded

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the machine code of a signature."""
        with locked(Path(self._cache_path)):
            super().save_overload(sig, data)

    def _portable_exists(self) -> bool:
        """Return True if there is a file of the function, and this CPU, which was not chosen by hand, can run it."""
        index = Path(self._cache_path, f"{self._impl.filename_base}.nbi")
        return config.CPU_NAME is None and index.exists() and not missing_cpu_features()

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Return all that machine code depends on. numba's own key of a closure is another one in each process."""
        fields = tuple(_tuple_fields(kind) for kind in sig)
        cpu: tuple[str, ...] = codegen.magic_tuple()
        if self._is_portable:
            cpu = (cpu[0], *PORTABLE_KEY)
        return sig, cpu, digest_of(self._py_func), repr(self._options), fields, self._is_inner


@contextmanager
def locked(folder: Path) -> Generator[None]:
    """Keep other processes out of a folder of cached machine code.

    numba writes the index before the machine code: without the lock, another process could load old code under the
    new entry, or the code of another signature.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = (folder / "kernels.lock").open("ab")
    except OSError:  # nothing can be saved in this folder
        yield
        return
    with lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


PORTABLE_KEY = (PORTABLE_CPU, "")  # name and further features, in the key of machine code
PORTABLE_VARIABLES = {"NUMBA_CPU_NAME": PORTABLE_CPU, "NUMBA_CPU_FEATURES": ""}  # they make numba compile for it


@cache
def missing_cpu_features() -> tuple[str, ...]:
    """Return the features of the portable CPU that this machine's lacks."""
    if platform.machine() != "x86_64":
        return ()
    present = get_host_cpu_features().split(",")
    return tuple(name for name in X86_64_V3 if f"+{name}" not in present)


def _tuple_fields(kind: Any) -> Any:
    """Return the field names of a named tuple, also of nested ones: machine code knows fields by their index."""
    if issubclass(type(kind), BaseNamedTuple):
        return kind.fields, tuple(_tuple_fields(field) for field in kind.types)
    return None


def digest_of(function: Callable[..., Any]) -> str:
    """SHA-256 of a function's code, and of all constants and compiled functions that it uses, directly or not.

    It is computed at the first call: before, the function's module may not be complete.
    """
    digests, waiting = dict[Any, bytes](), [function]
    while waiting:
        if (current := waiting.pop()) not in digests:
            digests[current], used = _direct_digest(current)
            waiting += used
    return hashlib.sha256(b"".join(digests.values())).hexdigest()


@cache
def _direct_digest(function: Any) -> tuple[bytes, tuple[Any, ...]]:
    """Return the digest of a function's code and constants, and the functions behind the compiled ones it calls."""
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
            digest.update(repr((name, value.targetoptions)).encode())
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
            for index, item in enumerate(value):
                add_value(str(index), item)
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
    """Return the names that a function reads, including nested functions, each once."""
    nested = (constant for constant in code.co_consts if isinstance(constant, CodeType))
    return tuple(dict.fromkeys([*code.co_names, *(name for inner in nested for name in _names_in(inner))]))
