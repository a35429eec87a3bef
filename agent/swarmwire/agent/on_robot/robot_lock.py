"""Who drives a robot from this machine: one process at a time, which whoever stops the motors asks to do so.

The lock is a file that a process holds with `flock`, so that it is free as soon as that process is gone, however it
ended. In it stands the process, and behind it how it fared with the last emergency stop that it was asked for here.
"""

import fcntl
import hashlib
import os
import signal
import tempfile
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.comms.clock import Clock, to_ns
from swarmwire.comms.errors import BadInput, SwarmwireError

STOPPED, OUT_OF_REACH = "stopped", "unreached"
ASKS_BY = signal.SIGUSR1
CONFIRM_S = 2.0  # so long a stop that was asked for may take
TAKE_S = 0.5  # so long whoever only looks, or is about to end, may hold up the next agent
EACH_NS = to_ns(0.02)


class NotStopped(SwarmwireError):
    """The process that drives the robot was asked to stop it, and does not say that it did."""


class RobotLock:
    """The lock of one robot, as its driver reaches it."""

    def __init__(self, kind: str, driver: Driver, clock: Clock) -> None:
        """`kind` is the driver's name; the clock is the wall's, however fast the robot is."""
        digest = hashlib.sha256(driver.target.encode()).hexdigest()[:16]
        self._path, self._clock = _folder() / f"{kind}-{digest}.lock", clock
        self._told = f"the robot at {driver.address or driver.target}"
        self._file: int | None = None

    @contextmanager
    def held(self, where: str) -> Generator[None]:
        """Hold it; BadInput at `driver.address` in `where` while another process does."""
        file = self._opened()
        try:
            if not self._locked(file, fcntl.LOCK_EX, TAKE_S):
                held = f"{self._told} is driven by process {self._holder() or 'unknown'} here"
                raise BadInput(where, "driver.address", f"expected a robot that no agent drives: {held}")
            self._file = file
            self.tell("")
            yield
            os.truncate(file, 0)
        finally:
            self._file = None
            fcntl.flock(file, fcntl.LOCK_UN)  # which processes that the agent forked hold, too
            os.close(file)

    def tell(self, how: str) -> None:
        """Say in the lock that is held how the emergency stop went: STOPPED or OUT_OF_REACH."""
        if self._file is not None:
            told = f"{os.getpid()} {how}\n".encode()
            os.pwrite(self._file, told, 0)
            os.truncate(self._file, len(told))

    def stopped_by_holder(self) -> int | None:
        """The process that drives the robot, once it has stopped it for good; None if there is none.

        NotStopped if it does not say so in 2 s.
        """
        file = self._opened()
        try:
            end_ns, asked = self._clock.now_ns() + to_ns(CONFIRM_S), None
            while not self._locked(file, fcntl.LOCK_SH, 0.0):
                holder, told = self._holder(), self._words()[1:]
                if holder and holder != asked:
                    with suppress(ProcessLookupError):
                        os.kill(holder, ASKS_BY)
                    asked = holder
                elif holder and told == [STOPPED]:
                    return holder
                if self._clock.now_ns() >= end_ns:
                    if holder is None:  # what a dead agent has left behind, which cannot be asked
                        return None
                    raise NotStopped(self._unconfirmed(holder, told))
                self._clock.sleep_until(self._clock.now_ns() + EACH_NS)
            return None
        finally:
            os.close(file)

    def _unconfirmed(self, holder: int, told: list[str]) -> str:
        if told == [OUT_OF_REACH]:
            return f"process {holder} cannot reach {self._told}, and stops it as soon as it can"
        return f"process {holder} drives {self._told}, and did not say within {CONFIRM_S:g} s that it stopped it"

    def _opened(self) -> int:
        return os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)

    def _locked(self, file: int, how: int, patience_s: float) -> bool:
        end_ns = self._clock.now_ns() + to_ns(patience_s)
        while True:
            try:
                fcntl.flock(file, how | fcntl.LOCK_NB)
            except BlockingIOError:
                if self._clock.now_ns() >= end_ns:
                    return False
                self._clock.sleep_until(self._clock.now_ns() + EACH_NS)
            else:
                return True

    def _words(self) -> list[str]:
        return self._path.read_text(encoding="ascii", errors="replace").split()

    def _holder(self) -> int | None:
        """The process that the lock names, if it is there."""
        words = self._words()
        if not words or not words[0].isdecimal():
            return None
        try:
            os.kill(int(words[0]), 0)
        except (ProcessLookupError, PermissionError):
            return None
        return int(words[0])


def _folder() -> Path:
    """This user's own folder for what runs; BadInput if somebody else has put one in its place."""
    runtime = os.environ.get("XDG_RUNTIME_DIR")
    folder = Path(runtime) / "swarmwire" if runtime else Path(tempfile.gettempdir()) / f"swarmwire-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        owner = folder.lstat().st_uid
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder for locks of robots: {error.strerror}") from None
    if folder.is_symlink() or owner != os.getuid():
        raise BadInput(str(folder), "", "expected a folder of this user's own, for locks of robots")
    return folder


# --- Emergency stops that another process of this machine asks for, by a signal: heeded by a thread of its own.


END = b"\0"  # no signal has this number


@contextmanager
def stop_requests(estop: Callable[[], None], tell: Callable[[str], None]) -> Generator[None]:
    """While it holds, the signal calls `estop`, and `tell` is told how that went.

    The interpreter writes the numbers of signals into a pipe at once, whatever the main thread is busy with; a driver
    that is stopped in the midst of a command to it, by the thread that gave it, could wait for itself for ever.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)

    def heed() -> None:
        while (numbers := os.read(reader, 64)) and END not in numbers:
            if ASKS_BY in numbers:
                try:
                    estop()
                except DriverLost:
                    tell(OUT_OF_REACH)
                else:
                    tell(STOPPED)

    before = signal.signal(ASKS_BY, _nothing), signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=heed, name="stop requests", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before[1])
        # One that comes too late must not do what it does by default, which is to kill.
        signal.signal(ASKS_BY, signal.SIG_IGN if before[0] in (None, signal.SIG_DFL) else before[0])
        os.write(writer, END)
        thread.join()
        os.close(reader)
        os.close(writer)


def _nothing(_: int, __: FrameType | None) -> None:
    """What the signal does besides: without a handler it kills."""
