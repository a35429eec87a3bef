"""Settings for all tests: Hypothesis profiles, the order of the unit tests, and what a unit test may not do.

The tier of a test is its directory: `unit`, `integration`, `statistics`, `docs`, `release`.
"""

import importlib
import os
import platform
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numba
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.charmap import charmap
from numba.core.event import TimingListener, install_listener

# The first example may wait for the compiler. `quick` is for `make test`, `full` for `make test-all`.
_SHARED: dict[str, Any] = {
    "deadline": None,
    "derandomize": True,
    "database": None,
    "print_blob": True,
    "suppress_health_check": [HealthCheck.too_slow],
}
settings.register_profile("quick", max_examples=20, **_SHARED)
settings.register_profile("full", max_examples=100, **_SHARED)
PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "quick")
settings.load_profile(PROFILE)

TESTS = Path(__file__).parent
UNIT_LIMIT_S = float(os.environ.get("UNIT_LIMIT_S", "2"))  # of processor time, so that a busy machine fails no test
# The order of the unit tests, by the start of their path. Of two workers the first then compiles the kernels of radio
# and world, each once, while the second runs tests that need none of them; whole runs, which need all, come last.
ORDER = ("comms/air", "comms/geometry", "comms/events", "world", "agent/behaviours", "metrics", "", "deploy", "test_")
MANY = 200  # unit tests: fewer start sooner without these
LOADED_LATE = (
    "matplotlib.pyplot",
    "polars",
    "rerun",
    "rich.console",
    "scipy.stats",
    "optuna",
    "asyncssh",
    "rosbags.typesys",
)
STARTS_A_PROCESS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.exec", "os.system", "time.sleep"}

_too_slow: list[str] = []
_unit_test = False  # whether a unit test is running in this process


def pytest_configure() -> None:
    """What a shell starts in the background, or by nohup, ignores Ctrl-C or hang-ups; so would all that tests start."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Unit tests in their order, then all else as it comes."""
    items.sort(key=_rank)  # stable


def pytest_collection_finish(session: pytest.Session) -> None:
    """Load what the product loads late, so that the first test that needs it does not pay for it."""
    if sum(map(_is_unit, session.items)) > MANY:
        for name in LOADED_LATE:
            with suppress(ImportError):  # an extra that is not installed
                importlib.import_module(name)
        charmap()  # Hypothesis makes its table of letters


def _rank(item: pytest.Item) -> int:
    if not _is_unit(item):
        return len(ORDER)
    path = item.path.relative_to(TESTS / "unit").as_posix()
    matching = [at for at, start in enumerate(ORDER) if start and path.startswith(start)]
    return matching[0] if matching else ORDER.index("")


def _is_unit(item: pytest.Item) -> bool:
    return item.path.is_relative_to(TESTS / "unit")


def _refuse_processes(event: str, _: tuple[Any, ...]) -> None:
    if _unit_test and event in STARTS_A_PROCESS:
        raise AssertionError(f"a unit test calls {event}: move it to tests/integration")


platform.processor()  # asks a program once; what a run says of its machine then needs none
sys.addaudithook(_refuse_processes)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """A unit test starts no process and does not sleep."""
    global _unit_test  # noqa: PLW0603 - an audit hook takes no argument of ours and cannot be removed
    _unit_test = _is_unit(item)
    try:
        return (yield)
    finally:
        _unit_test = False


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Note the processor time of a unit test without that of the compiler, which only an empty cache costs."""
    compiling, before_s = TimingListener(), time.process_time()
    try:
        with install_listener("numba:compile", compiling):
            return (yield)
    finally:
        compiled_s = compiling.duration if compiling.done else 0.0
        if _is_unit(item) and PROFILE == "quick" and sys.gettrace() is None and not numba.config.DISABLE_JIT:
            item.user_properties.append(("cpu_s", time.process_time() - before_s - compiled_s))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect the unit tests that took too long; under xdist, in the process that prints."""
    cpu_s = dict(report.user_properties).get("cpu_s", 0.0)
    if report.when == "call" and isinstance(cpu_s, float) and cpu_s > UNIT_LIMIT_S:
        _too_slow.append(f"{report.nodeid}: {cpu_s:.1f} s")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A unit test that is too slow fails the tier."""
    if _too_slow and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the unit tests that were too slow."""
    for line in _too_slow:
        terminalreporter.write_line(f"TOO SLOW for a unit test (limit {UNIT_LIMIT_S:g} s of processor time): {line}")
