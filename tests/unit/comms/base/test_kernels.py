"""Compiled functions: the cache on disk, calls between kernels, and numba itself, which stays as it is."""

import fcntl
import gc
import importlib
import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import ZipFile

import numba
import pytest
from numba.core import types
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.cpu import CPUTargetOptions
from numba.core.dispatcher import Dispatcher
from numba.core.registry import cpu_target

from swarmwire.comms.base import draws_compiled, kernel_archive
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.kernels import PORTABLE_KEY, PRIVATE_NAMES, compile_events, digest_of, kernel, njit

SOURCE = """
from swarmwire.comms.base.kernels import kernel, njit
import {other} as other
from {other} import DEEP, Pair, doubled

SHIFT = 1.0

@njit()
def plain(x):
    return doubled(x) + DEEP + other.FAR + SHIFT

def adding(function):
    @njit()
    def added(x):
        return function(x) + SHIFT

    return added

within = adding(doubled)

@kernel(from_python=True)
def first(pair):
    return pair.a
"""
OTHER = """
from typing import NamedTuple
from swarmwire.comms.base.kernels import kernel

DEEP, FAR, FACTOR = 10.0, 100.0, 2.0

class Pair(NamedTuple):
    a: float
    b: float

@kernel()
def doubled(x):
    return FACTOR * x
"""
needs_compiler = pytest.mark.skipif(not hasattr(draws_compiled.uniform, "overloads"), reason="kernels are plain Python")


class Single(NamedTuple):
    """A tuple to look at the type that numba has for it."""

    x: int


class Modules:
    """Two modules of a folder, imported anew each time."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.other = folder, OTHER

    def imported(self):
        (self.folder / "kernels_other.py").write_text(self.other)
        (self.folder / "kernels_made.py").write_text(SOURCE.format(other="kernels_other"))
        for name in ("kernels_made", "kernels_other"):
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module("kernels_made")


@pytest.fixture
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Modules]:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # files change within the second that bytecode goes by
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "machine-code"))
    yield Modules(tmp_path)
    for name in ("kernels_made", "kernels_other"):
        sys.modules.pop(name, None)


def hits(compiled) -> int:
    return sum(compiled.stats.cache_hits.values())


@needs_compiler
@pytest.mark.parametrize(("name", "result"), [("plain", 113.0), ("within", 3.0)])
def test_machine_code_is_reused(modules, name, result):
    for expected_hits in (0, 1):
        compiled = getattr(modules.imported(), name)
        assert compiled(1.0) == result
        assert hits(compiled) == expected_hits


@needs_compiler
@pytest.mark.parametrize(
    ("name", "old", "new", "before", "after"),
    [
        ("plain", "DEEP, FAR, FACTOR = 10.0", "DEEP, FAR, FACTOR = 20.0", 113.0, 123.0),
        ("plain", "100.0, 2.0", "200.0, 2.0", 113.0, 213.0),
        ("plain", "100.0, 2.0", "100.0, 3.0", 113.0, 114.0),
        ("plain", "return FACTOR * x", "return FACTOR * x + 1.0", 113.0, 114.0),
        ("within", "return FACTOR * x", "return FACTOR * x + 1.0", 3.0, 4.0),
        ("plain", "@kernel()", '@kernel(error_model="numpy")', 113.0, 113.0),
    ],
    ids=["constant", "constant by its module", "constant of a kernel", "kernel", "kernel of a closure", "options"],
)
def test_machine_code_is_compiled_again_after_a_change_elsewhere(modules, name, old, new, before, after):
    assert getattr(modules.imported(), name)(1.0) == before
    modules.other = OTHER.replace(old, new)
    compiled = getattr(modules.imported(), name)
    assert (compiled(1.0), hits(compiled)) == (after, 0)


@needs_compiler
def test_machine_code_is_locked_between_index_and_code(modules, monkeypatch, tmp_path):
    written, write = [], IndexDataCacheFile._save_data

    def kept_out(file, name, data):
        for lock in tmp_path.rglob("*.lock"):
            with lock.open("ab") as other, pytest.raises(BlockingIOError):
                fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
            written.append(name)
        write(file, name, data)

    monkeypatch.setattr(IndexDataCacheFile, "_save_data", kept_out)
    assert modules.imported().plain(1.0) == 113.0
    assert written


@needs_compiler
@pytest.mark.parametrize(
    "changed",
    [
        OTHER.replace("    a: float\n    b: float\n", "    b: float\n    a: float\n"),
        OTHER.replace("class Pair(", "class Couple(") + "\n\nPair = Couple\n",
    ],
    ids=["fields reordered", "renamed"],
)
def test_machine_code_differs_for_other_tuples(modules, changed):
    for source in (OTHER, changed):
        modules.other = source
        module = modules.imported()
        assert module.first(module.Pair(a=1.0, b=2.0)) == 1.0


@pytest.fixture
def archive(modules, monkeypatch, tmp_path) -> Path:
    """An archive of the module's functions, as if this machine's CPU were the portable one; the cache is empty then."""
    codegen = type(cpu_target.target_context.codegen())
    with monkeypatch.context() as elsewhere:
        elsewhere.setattr(codegen, "magic_tuple", lambda _: ("triple", *PORTABLE_KEY))
        modules.imported().plain(1.0)
    monkeypatch.setattr(codegen, "magic_tuple", lambda _: ("triple", "other", "+feature"))
    files = {name: tmp_path / name for name in ("kernels_made.py", "kernels_other.py")}
    monkeypatch.setattr(kernel_archive, "sources", lambda: files)
    kernel_archive._impl.cache_clear()
    assert kernel_archive.write_archive(tmp_path / "kernels.zip") >= 2  # plain, and what it calls
    shutil.rmtree(tmp_path / "machine-code")
    return tmp_path / "kernels.zip"


@needs_compiler
def test_kernel_archive_spares_another_cpu_to_compile(modules, archive, monkeypatch):
    assert kernel_archive.read_archive(archive) >= 2
    compiled = modules.imported().plain
    assert (compiled(1.0), hits(compiled)) == (113.0, 1)
    monkeypatch.setattr(numba.config, "CPU_NAME", "chosen")  # by hand: its own functions, and no others
    compiled = modules.imported().plain
    assert (compiled(1.0), hits(compiled)) == (113.0, 0)


@needs_compiler
@pytest.mark.parametrize(
    ("key", "value"),
    [("machine", "m68k"), ("cpu", "x86-64-v9"), ("python", "2.7"), ("numba", "0.1"), ("sources", {}), ("format", 0)],
)
def test_kernel_archive_of_another_machine_is_refused_with_the_key(archive, tmp_path, key, value):
    with ZipFile(archive) as packed:
        manifest = json.loads(packed.read("kernels.json"))
    with ZipFile(tmp_path / "other.zip", "w") as packed:
        packed.writestr("kernels.json", json.dumps({**manifest, key: value}))
    with pytest.raises(BadInput) as refused:
        kernel_archive.read_archive(tmp_path / "other.zip")
    assert (refused.value.where, refused.value.key) == (str(tmp_path / "other.zip"), key)


@needs_compiler
def test_kernel_archive_is_refused_on_a_cpu_without_its_instructions(archive, monkeypatch):
    monkeypatch.setattr(kernel_archive, "missing_cpu_features", lambda: ("avx2",))
    with pytest.raises(BadInput, match="avx2"):
        kernel_archive.read_archive(archive)


@pytest.mark.parametrize("content", [None, b"", b"PK"])
def test_kernel_archive_that_is_none_is_refused(tmp_path, content):
    if content is not None:
        (tmp_path / "none.zip").write_bytes(content)
    with pytest.raises(BadInput, match=r"none\.zip"):
        kernel_archive.read_archive(tmp_path / "none.zip")


def test_digest_ignores_comments(modules):
    before = digest_of(getattr(modules.imported().plain, "py_func", modules.imported().plain))
    modules.other = OTHER + "\n# a comment\n"
    assert digest_of(getattr(modules.imported().plain, "py_func", modules.imported().plain)) == before


@needs_compiler
def test_kernel_for_kernels_cannot_be_called_from_python():
    @kernel()
    def added(x):
        return x + 1

    with pytest.raises(TypeError, match="added"):
        added(1)


@needs_compiler
def test_compiled_function_compiles_its_callee_once_for_all_constants():
    @njit(cache=False)
    def scaled(x, by, plus=1):
        return x * by + plus

    @njit(cache=False)
    def both(x):
        return scaled(x, 2) + scaled(x, 3, plus=4)

    from_python: Any = scaled
    assert (both(1.5), both(2)) == (12.5, 15)
    assert from_python.signatures == []  # no way in, before Python calls it
    assert (from_python(1.5, 2), gc.isenabled()) == (4.0, True)
    assert len(from_python.signatures) == 1


@needs_compiler
def test_compile_events_have_the_nesting_depth_and_end_with_the_context():
    @numba.njit()
    def inner(x):
        return x + 1

    @numba.njit()
    def outer(x):
        return inner(x)

    depths = list[tuple[str, int]]()
    with compile_events(lambda depth: depths.append(("start", depth)), lambda depth: depths.append(("end", depth))):
        assert outer(1) == 2
    assert outer(1.0) == 2.0
    assert depths == [("start", 0), ("start", 1), ("end", 1), ("end", 0)]


@needs_compiler
def test_plain_numba_function_keeps_numbas_behaviour():
    @numba.njit()
    def inverse(x):
        return 1.0 / x

    plain: Any = inverse
    assert type(plain._cache) is NullCache
    names = "_compile_for_args", "add_overload", "get_call_template", "get_overload"
    assert all(getattr(plain, name).__func__ is getattr(Dispatcher, name) for name in names)
    assert inverse(2.0) == 0.5
    with pytest.raises(ZeroDivisionError):
        inverse(0.0)


@needs_compiler
def test_numba_has_all_private_names() -> None:
    compiled, cache = numba.njit(digest_of), FunctionCache(digest_of)
    owners = {
        "Dispatcher": compiled,
        "FunctionCache": cache,
        "IndexDataCacheFile": IndexDataCacheFile,
        "BaseNamedTuple": types.NamedTuple((types.int64,), Single),
        "options": CPUTargetOptions,
    }
    missing = {(owner, name) for owner in owners for name in PRIVATE_NAMES[owner] if not hasattr(owners[owner], name)}
    assert not missing
    assert owners.keys() == PRIVATE_NAMES.keys()


def test_numba_minor_version_is_pinned() -> None:
    for project in ("comms", "world"):
        text = (Path(__file__).parents[4] / project / "pyproject.toml").read_text()
        minor = int(numba.__version__.split(".")[1])
        assert f'"numba>=0.{minor},<0.{minor + 1}"' in text
