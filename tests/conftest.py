"""Settings for all tests: Hypothesis profiles, the order of the unit tests, and what a unit test may not do.

The tier of a test is its directory: `unit`, `integration`, `statistics`, `docs`, `release`.
"""

import gc
import os
import platform
import signal
import sys
import time
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol
from hypothesis import HealthCheck, Phase, settings

# The first example may wait for the compiler. `quick` is for `make test`, `full` for `make test-all`, `soak` for
# `make soak`, in which tests/integration/test_fuzz.py runs for a quarter of an hour, test_soak.py for half an hour.
_SHARED: dict[str, Any] = {
    "deadline": None,
    "derandomize": True,
    "database": None,
    "print_blob": True,
    "suppress_health_check": [HealthCheck.too_slow],
    "phases": set(Phase) - {Phase.explain},  # which traces each line for minutes, and its hints are rarely of use
}
settings.register_profile("quick", max_examples=20, **_SHARED)
settings.register_profile("full", max_examples=100, **_SHARED)
settings.register_profile("soak", max_examples=1000, **_SHARED)
PROFILE = os.environ.get("HYPOTHESIS_PROFILE", "quick")
settings.load_profile(PROFILE)

UNIT = f"{Path(__file__).parent}/unit/"
UNIT_LIMIT_S = float(os.environ.get("UNIT_LIMIT_S", "2"))  # of processor time, so that a busy machine fails no test
# The order of the unit tests, by the start of their path. Of two workers the first then compiles the kernels of radio
# and world, each once, while the second runs tests that need none of them; whole runs, which need all, come last.
ORDER = (
    "comms/radio",
    "comms/test_geometry",
    "comms/test_events",
    "world",
    "agent/behaviours",
    "metrics",
    "",
    "agent/test_onnx_policy",
    "learn",
    "deploy",
    "test_",
)
# Tracing and Python in place of kernels slow all tests down; the full profile has more examples of each.
LIMITED = PROFILE == "quick" and sys.gettrace() is None and os.environ.get("NUMBA_DISABLE_JIT", "0") == "0"
CPU_S, TOO_SLOW = pytest.StashKey[float](), "too slow"
COMPILING_LIMIT_S = 300  # the first test that uses a kernel also compiles it: 802.11n for a minute on a core of its own
STARTS_A_PROCESS = {"subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn", "os.exec", "os.system"}

_too_slow: list[str] = []
_unit_test = False  # whether a unit test is running in this process


def pytest_configure(config: pytest.Config) -> None:
    """Add the limit of unit tests, and let tests be interrupted.

    What a shell starts in the background, or by nohup, ignores Ctrl-C or hang-ups; so would all that tests start.
    """
    if LIMITED:
        config.pluginmanager.register(AgainIfSlow())
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[object]:
    """Collect without garbage collection, and keep it away from what that made: a sixth of the time, in each worker."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Unit tests in their order, then all else as it comes; before them, what asks programs once.

    The process that only hands out tests does not get here, so it starts the workers without waiting for numba.
    """
    items.sort(key=_rank)  # stable
    for item in filter(_is_unit, items):
        if item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(COMPILING_LIMIT_S))
    platform.processor()  # what a run says of its machine then needs no program
    for module in ("matplotlib.font_manager", "swarmwire.comms.base.kernels"):
        import_module(module)


def _rank(item: pytest.Item) -> int:
    if not _is_unit(item):
        return len(ORDER)
    matching = [at for at, start in enumerate(ORDER) if start and str(item.path).startswith(start, len(UNIT))]
    return matching[0] if matching else ORDER.index("")


def _is_unit(item: pytest.Item) -> bool:
    return str(item.path).startswith(UNIT)


def _refuse_processes(event: str, _: tuple[Any, ...]) -> None:
    if _unit_test and event in STARTS_A_PROCESS:
        raise AssertionError(f"a unit test calls {event}: move it to tests/integration")


sys.addaudithook(_refuse_processes)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[object]:
    """A unit test starts no process."""
    global _unit_test  # noqa: PLW0603 - an audit hook takes no argument of ours and cannot be removed
    _unit_test = _is_unit(item)
    try:
        return (yield)
    finally:
        _unit_test = False


class AgainIfSlow:
    """Runs a slow unit test up to three times: the machine may be busy."""

    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
        """Run a unit test, again while it is too slow, and report the last."""
        if not _is_unit(item):
            return None
        item.ihook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
        reports = runtestprotocol(item, log=False, nextitem=nextitem)
        for _ in range(2):
            if item.stash.get(CPU_S, 0.0) > UNIT_LIMIT_S and all(report.passed for report in reports):
                item._initrequest()  # fresh fixtures, as pytest-rerunfailures makes them
                reports = runtestprotocol(item, log=False, nextitem=nextitem)
        if item.stash.get(CPU_S, 0.0) > UNIT_LIMIT_S:
            reports[-1].user_properties.append((TOO_SLOW, item.stash[CPU_S]))
        for report in reports:
            item.ihook.pytest_runtest_logreport(report=report)
        item.ihook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
        return True


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    """Note the processor time that a test takes, without that of the compiler: the first to use a kernel has it."""
    from swarmwire.comms.base.kernels import compile_events

    compiling_since_s = compiled_s = 0.0

    def begin(depth: int) -> None:
        nonlocal compiling_since_s
        if depth == 0:
            compiling_since_s = time.process_time()

    def end(depth: int) -> None:
        nonlocal compiled_s
        if depth == 0:
            compiled_s += time.process_time() - compiling_since_s

    before_s = time.process_time()
    try:
        with compile_events(begin, end):
            return (yield)
    finally:
        item.stash[CPU_S] = time.process_time() - before_s - compiled_s


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect the unit tests that took too long; under xdist, in the process that prints."""
    cpu_s = dict(report.user_properties).get(TOO_SLOW)
    if cpu_s is not None:
        _too_slow.append(f"{report.nodeid}: {cpu_s:.1f} s")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """A unit test that is too slow fails the tier."""
    if _too_slow and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the unit tests that were too slow."""
    for line in _too_slow:
        terminalreporter.write_line(f"TOO SLOW for a unit test (limit {UNIT_LIMIT_S:g} s of processor time): {line}")
