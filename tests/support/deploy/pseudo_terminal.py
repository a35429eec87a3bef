"""A terminal as tests use it: a real command in a pseudo-terminal, what it shows, and keys typed at it."""

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import sys
import termios
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

QUIET_S = 60.0  # for so long a command may show nothing
CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
PICTURE = re.compile(r"╭─.*?─╯", re.DOTALL)  # one panel


class Terminal:
    """The user's side of a pseudo-terminal."""

    def __init__(self, process: "subprocess.Popen[bytes]", side: int, before: list[Any]) -> None:
        self.process, self._side, self._before = process, side, before
        self.output = b""

    def type(self, keys: str) -> None:
        os.write(self._side, keys.encode())

    def wait(self, until: Callable[[str], bool]) -> str:
        """The newest panel, once it is as it should be; only those that come from now on count."""
        count = len(self.pictures())
        while True:
            for picture in self.pictures()[count:]:
                count += 1
                if until(picture):
                    return picture
            assert self._read(), f"it ended or stood still: {self.text[-3000:]}"

    def transcript(self) -> str:
        """All that it showed, once it has ended."""
        while self._read():
            pass
        self.process.wait(20.0)
        return self.text

    def close(self) -> None:
        """Close the window: the system tells the command by SIGHUP, and its output goes nowhere."""
        os.close(self._side)
        self._side = -1

    @property
    def open(self) -> bool:
        """Whether the window was not closed."""
        return self._side >= 0

    @property
    def text(self) -> str:
        return CODES.sub("", self.output.decode(errors="ignore")).replace("\r\n", "\n")

    def pictures(self) -> list[str]:
        return PICTURE.findall(self.text)

    def changed(self) -> bool:
        """Whether the terminal's attributes are others than at the start."""
        return termios.tcgetattr(self._side) != self._before

    def _read(self) -> bool:
        ready, _, _ = select.select([self._side], [], [], QUIET_S)
        try:
            new = os.read(self._side, 65536) if ready else b""
        except OSError:  # nobody is at the other side any more
            new = b""
        self.output += new
        return bool(new)


@contextmanager
def terminal(*arguments: str | Path, columns: int = 80, rows: int = 24) -> Generator[Terminal]:
    """`swarmwire` in a terminal of its own; it is ended with the test."""
    user, other = pty.openpty()
    fcntl.ioctl(other, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    before = termios.tcgetattr(user)
    start = "import os, sys; os.login_tty(0); os.execv(sys.executable, [sys.executable, '-m', *sys.argv[1:]])"
    command = [sys.executable, "-c", start, "swarmwire.deploy", *map(str, arguments)]
    environment = {**os.environ, "TERM": "xterm-256color"}
    process = subprocess.Popen(command, stdin=other, stdout=other, stderr=other, env=environment)
    os.close(other)
    window = Terminal(process, user, before)
    try:
        yield window
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        if window.open:
            window.close()
