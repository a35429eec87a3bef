"""Mutants tried one by one: pytest forks a process for each, which runs the tests on the changed module.

Nothing is written. Inside functions the change is put in place when all tests are collected: whoever imported a
function has the changed one, since its code is exchanged. What is changed outside of functions (numbers, decorators) is
in force before anything that needs the module is imported.
"""

import gc
import importlib
import os
import resource
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.util import spec_from_file_location
from types import CodeType, FunctionType
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from tests.tools.mutants.mutant import Mutant

HEAVY = ("hypothesis.extra.numpy", "numba", "scipy.stats")  # that tests import
LEAST_S = 15  # of a processor for any mutant: those that go round and round end then
TIMES = 4  # and at the earliest after so many times what the tests take without a change
MOST_BYTES = 8 * 2**30  # of addresses, for those that allocate without end
UNTRIED = 99  # how a process ends in which the change could not be put in place
OPTIONS = (
    *("-o", "addopts=--import-mode=importlib", "-p", "no:terminal"),
    *("-x", "-s", "-m", "not slow"),
    *("-p", "no:cacheprovider", "-p", "no:xdist", "-p", "no:rerunfailures"),
    *("-W", "ignore::pytest.PytestAssertRewriteWarning"),
    *("-W", "ignore:overflow encountered:RuntimeWarning"),  # of numpy's scalars, where compiled words wrap
)


@dataclass(frozen=True)
class Attempt:
    """What the tests said of one mutant."""

    mutant: Mutant
    killed: bool
    took_s: float  # of a processor


class _Changed(SourceFileLoader):
    """A module from other source than that of its file."""

    def __init__(self, mutant: Mutant) -> None:
        super().__init__(mutant.module, str(mutant.path))
        self._mutant = mutant

    def get_code(self, fullname: str) -> CodeType:
        return _compiled(self._mutant)


class _Finder:
    """Finds the one changed module."""

    def __init__(self, mutant: Mutant) -> None:
        self._mutant = mutant

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        if name != self._mutant.module:
            return None
        return spec_from_file_location(name, self._mutant.path, loader=_Changed(self._mutant))


def _compiled(mutant: Mutant) -> CodeType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what the compiler thinks of `is 3` is not what is tested
        return compile(mutant.source, str(mutant.path), "exec", dont_inherit=True)


def _put_in_place(mutant: Mutant) -> None:
    """Exchange the code of the module's functions for that of the changed ones."""
    module = sys.modules[mutant.module]
    changed: dict[str, Any] = {**vars(module)}
    try:
        exec(_compiled(mutant), changed)
    except Exception:  # noqa: BLE001 - a module that cannot be imported counts as killed, whatever it raises
        os._exit(pytest.ExitCode.TESTS_FAILED)
    path = str(mutant.path)
    olds, news = dict(_functions(vars(module), path)), dict(_functions(changed, path))
    for name, old in olds.items():
        old.__code__, old.__defaults__, old.__kwdefaults__ = (
            news[name].__code__,
            news[name].__defaults__,
            news[name].__kwdefaults__,
        )


def _functions(of: Mapping[str, Any], path: str) -> Iterator[tuple[str, FunctionType]]:
    """The functions among these that are written in the file, and those of classes, by qualified name."""
    for thing in of.values():
        for inner in (getattr(thing, name, None) for name in ("__func__", "fget", "__wrapped__")):
            if isinstance(inner, FunctionType) and inner.__code__.co_filename == path:
                yield inner.__qualname__, inner
        if isinstance(thing, FunctionType) and thing.__code__.co_filename == path:
            yield thing.__qualname__, thing
        elif isinstance(thing, type) and thing.__module__ == of.get("__name__", thing.__module__):
            yield from _functions(vars(thing), path)


@given(st.integers())
def _warm_up(number: int) -> None:
    """A test of nothing."""


class _Forks:
    """Forks pytest for each mutant; once before without a change, since the tests must pass."""

    def __init__(self, module: str, mutants: Sequence[Mutant], tell: Callable[[Attempt], None]) -> None:
        self._module, self._mutants, self._tell = module, mutants, tell
        self._limit_s = 600
        self.is_child = False

    def pytest_configure(self) -> None:
        # The first failure is enough: no smaller example is looked for.
        quick = settings(max_examples=20, phases=(Phase.explicit, Phase.generate))
        settings.register_profile("mutants", quick)
        settings.load_profile("mutants")
        importlib.import_module(self._module)
        del sys.modules[self._module]
        package, _, name = self._module.rpartition(".")
        if package:
            delattr(sys.modules[package], name)  # where `from package import name` looks first

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self) -> None:
        failed, took_s = self._run(lambda: None)
        if failed and not self.is_child:
            pytest.exit(f"{self._module}: its tests fail without any change", returncode=1)
        self._limit_s = max(LEAST_S, round(TIMES * took_s))
        if outside := [mutant for mutant in self._mutants if not mutant.is_inside]:
            for name in HEAVY:
                importlib.import_module(name)
            self._try(outside)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self) -> bool | None:
        if not self.is_child:
            _warm_up()  # what hypothesis does at its first test, a third of a second, is done once
        self._try([mutant for mutant in self._mutants if mutant.is_inside])
        return None if self.is_child else True

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, call: pytest.CallInfo[None]) -> None:
        if self.is_child and call.excinfo is not None and not call.excinfo.errisinstance(pytest.skip.Exception):
            os._exit(pytest.ExitCode.TESTS_FAILED)  # at once: reports and what is put away take longer than most tests

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, exitstatus: int) -> None:
        if self.is_child:
            os._exit(exitstatus)

    def _try(self, mutants: Sequence[Mutant]) -> None:
        for mutant in mutants:
            if self.is_child:
                return

            def change(mutant: Mutant = mutant) -> None:
                if mutant.is_inside:
                    _put_in_place(mutant)
                else:
                    sys.meta_path.insert(0, _Finder(mutant))

            killed, took_s = self._run(change)
            if not self.is_child:
                self._tell(Attempt(mutant, killed, took_s))

    def _run(self, change: Callable[[], None]) -> tuple[bool, float]:
        """Whether the tests failed, and how long they took; in the child, which goes on, nothing of meaning."""
        if self.is_child:
            return False, 0.0
        gc.freeze()  # what is there before the fork is not looked at again after it
        pid = os.fork()
        if pid:
            _, status, used = os.wait4(pid, 0)
            code = os.waitstatus_to_exitcode(status)
            if code in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED, UNTRIED):
                pytest.exit(f"{self._module}: no tests were run (exit {code})", returncode=1)
            return code != 0, used.ru_utime + used.ru_stime
        self.is_child = True
        resource.setrlimit(resource.RLIMIT_CPU, (self._limit_s, self._limit_s))
        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        try:
            change()
        except Exception:  # noqa: BLE001 - it is this file that failed, and that must not count as killed
            os._exit(UNTRIED)
        return False, 0.0


def attempts(module: str, mutants: Sequence[Mutant], tests: Sequence[str], tell: Callable[[Attempt], None]) -> None:
    """Try these mutants of a module by these tests, and `tell` of each; RuntimeError if the tests cannot be run."""
    forks = _Forks(module, mutants, tell)
    os.environ.pop("PYTEST_ADDOPTS", None)  # meant for the tests of all else; without its terminal pytest knows no -v
    code = pytest.main([*OPTIONS, *tests], plugins=[forks])
    if forks.is_child:
        os._exit(code)  # the change itself has ended the tests, before the first
    if code != 0:
        raise RuntimeError(f"{module}: the tests cannot be run: {', '.join(tests)}")
