"""The page: a browser, and a stand-in for a run."""

import contextlib
import re
import shutil
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import psutil
import pytest

from swarmwire.deploy.live.remote_control import Refused
from swarmwire.deploy.live.subscription import RunGone

QUIET = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync")  # fmt: skip
SOFTWARE_GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
PATIENCE_MS = 60_000  # of a machine that is busy


@contextlib.contextmanager
def paged(scenario: Path, out: Path, *options: str) -> Generator[tuple["subprocess.Popen[str]", str]]:
    """`swarmwire run --ui`, once it has told the page's address; whatever it started ends with the block."""
    command = [sys.executable, "-m", "swarmwire.deploy", "run", str(scenario), "--ui", "--out", str(out), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            text = ""
            while (match := re.search(r"open (http://127\.0\.0\.1:\d+/\S+/) in a browser", text)) is None:
                line = process.stdout.readline()
                assert line, text
                text += line
            yield process, match[1]
        finally:
            kill_family(process.pid)


def family(pid: int) -> list[psutil.Process]:
    """The process and all that it started; nothing if it has ended."""
    with contextlib.suppress(psutil.NoSuchProcess):
        return [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)]
    return []


def kill_family(pid: int) -> None:
    """Kill the process and all that it started."""
    for process in reversed(family(pid)):
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()


@contextlib.contextmanager
def chromium(address: str) -> Generator[Any]:
    """A page of chromium at this address, which shows no viewer: drawing it takes all that a small machine has.

    What goes wrong on the page fails the test.
    """
    faults: list[str] = []
    with launched() as browser:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.set_default_timeout(PATIENCE_MS)
        page.route("**/re_viewer*", lambda route: route.abort())
        page.on("pageerror", lambda error: faults.append(str(error)) if address in str(error.stack) else None)
        page.on(
            "response",
            lambda answer: faults.append(answer.url) if answer.url.startswith(address) and not answer.ok else None,
        )
        page.goto(address)
        yield page
    assert not faults, faults


@contextlib.contextmanager
def launched(*options: str) -> Generator[Any]:
    """Debian's chromium, driven by playwright."""
    sync = pytest.importorskip("playwright.sync_api", reason="needs playwright")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("needs chromium")
    with sync.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=[*QUIET, *options])
        try:
            yield browser
        finally:
            browser.close()


def requested_hosts(address: str) -> set[str]:
    """The hosts that a browser asks for something, from this address on until its viewer asks for the recording."""
    urls: list[str] = []
    with launched(*SOFTWARE_GL) as browser:
        page = browser.new_page(viewport={"width": 800, "height": 600})
        page.on("request", lambda request: urls.append(request.url))
        with page.expect_request("**/run.rrd", timeout=2 * PATIENCE_MS):
            page.goto(address, timeout=PATIENCE_MS)
    return {urlsplit(url).hostname or "" for url in urls}


class StandIn:
    """Keeps what it was asked for; refuses events that are not known, and is gone once `gone` is set."""

    def __init__(self) -> None:
        self.orders: list[tuple[str, Any]] = []
        self.tick, self.state, self.gone = 0, "running", False

    def status(self) -> dict[str, Any]:
        if self.gone:
            raise RunGone("nobody answers")
        metrics = {"order": 0.5, "rejoin_median": None}
        return {"tick": self.tick, "ticks": 100, "time_s": self.tick / 10, "state": self.state, "metrics": metrics,
                "measures_ms": 1.5, "alive": 3}  # fmt: skip

    def pause(self) -> None:
        self.orders.append(("pause", None))

    def resume(self) -> None:
        self.orders.append(("resume", None))

    def step(self, n: int = 1) -> None:
        self.orders.append(("step", n))

    def speed(self, factor: float | None) -> None:
        self.orders.append(("speed", factor))

    def stop(self) -> None:
        self.orders.append(("stop", None))

    def event(self, table: dict[str, Any]) -> int:
        if table.get("do") != "kill":
            raise Refused("do: expected something that can happen")
        self.orders.append(("event", table))
        return 7

    def end(self, number: int) -> None:
        self.orders.append(("end", number))
