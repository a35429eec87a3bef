"""Settings for all tests: Hypothesis profiles, the order of the unit tests, and what a unit test may not do.

The tier of a test is its directory: `unit`, `integration`, `statistics`, `docs`, `release`.
"""

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

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
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "quick"))

TESTS = Path(__file__).parent
UNIT_LIMIT_S = 2.0  # of processor time, so that a busy machine fails no test
# Tests of these folders call compiled kernels. They come first, and in this order: of two workers one then compiles
# them, each kernel once, while the other runs the tests that need none.
WARM_UP = "test_warm_up.py"
KERNELS = (WARM_UP, "comms/air", "world", "comms/geometry", "comms/events", "agent/behaviours", "deploy")
STARTS_A_PROCESS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.exec", "os.system", "time.sleep"}

_too_slow: list[str] = []
_unit_test = False  # whether a unit test is running in this process


def pytest_configure() -> None:
    """What a shell starts in the background, or by nohup, ignores Ctrl-C or hang-ups; so would all that tests start."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Unit tests that need kernels first, then the other unit tests, then all else."""
    items.sort(key=_rank)  # stable


def _rank(item: pytest.Item) -> int:
    if not _is_unit(item):
        return len(KERNELS) + 1
    path = item.path.relative_to(TESTS / "unit").as_posix()
    return next((at for at, start in enumerate(KERNELS) if path.startswith(start)), len(KERNELS))


def _is_unit(item: pytest.Item) -> bool:
    return item.path.is_relative_to(TESTS / "unit")


def _refuse_processes(event: str, _: tuple[Any, ...]) -> None:
    if _unit_test and event in STARTS_A_PROCESS:
        raise AssertionError(f"a unit test calls {event}: move it to tests/integration")


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
    """Note how much processor time a unit test takes."""
    before_s = time.process_time()
    try:
        return (yield)
    finally:
        if _is_unit(item):
            item.user_properties.append(("cpu_s", time.process_time() - before_s))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect the unit tests that took too long; under xdist, in the process that prints."""
    cpu_s = dict(report.user_properties).get("cpu_s", 0.0)
    if report.when == "call" and isinstance(cpu_s, float) and cpu_s > UNIT_LIMIT_S and WARM_UP not in report.nodeid:
        _too_slow.append(f"{report.nodeid}: {cpu_s:.1f} s")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A unit test that is too slow fails the tier."""
    if _too_slow and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the unit tests that were too slow."""
    for line in _too_slow:
        terminalreporter.write_line(f"TOO SLOW for a unit test (limit {UNIT_LIMIT_S:g} s of processor time): {line}")
