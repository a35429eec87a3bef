"""Commands on several machines: each a process whose lines a test waits for."""

import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

from tests.support.deploy.machines.namespaces import Machine

TIMEOUT_S = 60.0


class Started:
    """A command that runs; what it prints, on either stream, is read while it does."""

    def __init__(self, command: Sequence[str], cwd: Path | None = None) -> None:
        self.process = subprocess.Popen(
            command,
            cwd=cwd,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1", "COLUMNS": "200"},
        )
        self.lines: list[str] = []
        self._arrived: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reading = threading.Thread(target=self._read, daemon=True)
        self._reading.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._arrived.put(line.rstrip("\n"))
        self._arrived.put(None)

    @classmethod
    @contextmanager
    def running(cls, command: Sequence[str], cwd: Path | None = None) -> Generator["Started"]:
        """The command; killed with the context if it still runs."""
        started = cls(command, cwd)
        try:
            yield started
        finally:
            started.process.kill()
            started.process.wait()
            assert started.process.stdout is not None
            started.process.stdout.close()

    def said(self, *texts: str) -> str:
        """The next line that holds all these texts, waited for."""
        while (line := self._next()) is not None:
            if all(text in line for text in texts):
                return line
        raise AssertionError(f"it ended without {texts}: {self.lines}")

    def ended(self) -> int:
        """Its exit code, waited for."""
        while self._next() is not None:
            continue
        return self.process.wait(TIMEOUT_S)

    def _next(self) -> str | None:
        """The next line; None if there will be no more."""
        try:
            line = self._arrived.get(timeout=TIMEOUT_S)
        except queue.Empty:
            raise AssertionError(f"nothing more came for {TIMEOUT_S:g} s: {self.lines}") from None
        if line is not None:
            self.lines.append(line)
        return line

    def stop(self) -> int:
        """Its exit code after Ctrl-C."""
        self.process.send_signal(signal.SIGINT)
        return self.ended()


@contextmanager
def on(machine: Machine | None, *words: object, cwd: Path | None = None) -> Generator[Started]:
    """`swarmwire` with these words on a machine, or on this one; killed with the context if it still runs."""
    command = [sys.executable, "-m", "swarmwire.deploy", *map(str, words)]
    with Started.running(machine.command(*command) if machine else command, cwd) as started:
        yield started
