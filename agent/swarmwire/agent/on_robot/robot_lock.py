"""The lock of a robot, and emergency stops that one process of this machine requests from another.

One process at a time drives a robot. It holds a file with `flock`, so that the lock is free as soon as the process is
gone, however it ended. The file contains the process id, followed by the result of the last requested emergency stop:
`STOPPED` or `OUT_OF_REACH`.

A request is a signal to the process that holds the lock; `stop_requests` handles it in a thread, and the requester
(`RobotLock.stopped_by_holder`) reads the result from the file.
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
STOP_SIGNAL = signal.SIGUSR1
CONFIRM_TIMEOUT_S = 2.0  # for a requested stop
LOCK_TIMEOUT_S = 0.5  # a process that only looks, or that is about to end, may hold the lock for this long
POLL_NS = to_ns(0.02)
END = b"\0"  # ends the thread of stop requests; no signal has this number


class NotStopped(SwarmwireError):
    """The process that drives the robot did not confirm a requested stop."""


class RobotLock:
    """The lock of one robot, identified by its driver and address."""

    def __init__(self, kind: str, driver: Driver, clock: Clock) -> None:
        """`kind` is the driver's name; the clock is the wall clock, at any pace of the robot."""
        digest = hashlib.sha256(driver.target.encode()).hexdigest()[:16]
        self._path, self._clock = _folder() / f"{kind}-{digest}.lock", clock
        self._description = f"the robot at {driver.address or driver.target}"
        self._file: int | None = None

    @contextmanager
    def held(self, where: str) -> Generator[None]:
        """Hold the lock; BadInput at `driver.address` in `where` if another process holds it."""
        file = self._open()
        try:
            if not self._try_lock(file, fcntl.LOCK_EX, LOCK_TIMEOUT_S):
                held = f"{self._description} is driven by process {self._holder() or 'unknown'} here"
                raise BadInput(where, "driver.address", f"expected a robot that no agent drives: {held}")
            self._file = file
            self.tell("")
            yield
            os.truncate(file, 0)
        finally:
            self._file = None
            fcntl.flock(file, fcntl.LOCK_UN)  # processes that the agent forked hold it as well
            os.close(file)

    def tell(self, how: str) -> None:
        """Write the result of an emergency stop, STOPPED or OUT_OF_REACH, into the lock, if it is held."""
        if self._file is not None:
            line = f"{os.getpid()} {how}\n".encode()
            os.pwrite(self._file, line, 0)
            os.truncate(self._file, len(line))

    def stopped_by_holder(self) -> int | None:
        """Request an emergency stop: the process that drives the robot and stopped it; None if there is none.

        NotStopped without a confirmation within 2 s.
        """
        file = self._open()
        try:
            end_ns, signalled = self._clock.now_ns() + to_ns(CONFIRM_TIMEOUT_S), None
            while not self._try_lock(file, fcntl.LOCK_SH, 0.0):
                holder, result = self._holder(), self._words()[1:]
                if holder and holder != signalled:
                    with suppress(ProcessLookupError):
                        os.kill(holder, STOP_SIGNAL)
                    signalled = holder
                elif holder and result == [STOPPED]:
                    return holder
                if self._clock.now_ns() >= end_ns:
                    if holder is None:  # left behind by a dead agent, which cannot answer
                        return None
                    raise NotStopped(self._unconfirmed(holder, result))
                self._clock.sleep_until(self._clock.now_ns() + POLL_NS)
            return None
        finally:
            os.close(file)

    def _unconfirmed(self, holder: int, result: list[str]) -> str:
        if result == [OUT_OF_REACH]:
            return f"process {holder} cannot reach {self._description}, and stops it as soon as it can"
        missing = f"did not say within {CONFIRM_TIMEOUT_S:g} s that it stopped it"
        return f"process {holder} drives {self._description}, and {missing}"

    def _open(self) -> int:
        return os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)

    def _try_lock(self, file: int, how: int, timeout_s: float) -> bool:
        end_ns = self._clock.now_ns() + to_ns(timeout_s)
        while True:
            try:
                fcntl.flock(file, how | fcntl.LOCK_NB)
            except BlockingIOError:
                if self._clock.now_ns() >= end_ns:
                    return False
                self._clock.sleep_until(self._clock.now_ns() + POLL_NS)
            else:
                return True

    def _words(self) -> list[str]:
        return self._path.read_text(encoding="ascii", errors="replace").split()

    def _holder(self) -> int | None:
        """The process that the lock names, if it runs."""
        words = self._words()
        if not words or not words[0].isdecimal():
            return None
        try:
            os.kill(int(words[0]), 0)
        except (ProcessLookupError, PermissionError):
            return None
        return int(words[0])


def _folder() -> Path:
    """This user's runtime folder; BadInput if another user owns it."""
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


@contextmanager
def stop_requests(estop: Callable[[], None], tell: Callable[[str], None]) -> Generator[None]:
    """Within this context, the stop signal calls `estop`, and `tell` gets the result.

    A thread of its own handles the signal: the interpreter writes signal numbers into a pipe at once, even while the
    main thread is busy. A handler in the main thread could interrupt a command to the driver and then wait for ever
    for the lock that this command holds.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)

    def handle() -> None:
        while (numbers := os.read(reader, 64)) and END not in numbers:
            if STOP_SIGNAL in numbers:
                try:
                    estop()
                except DriverLost:
                    tell(OUT_OF_REACH)
                else:
                    tell(STOPPED)

    before = signal.signal(STOP_SIGNAL, _nothing), signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    thread = threading.Thread(target=handle, name="stop requests", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before[1])
        # A late signal must not have its default effect, which is to kill the process.
        signal.signal(STOP_SIGNAL, signal.SIG_IGN if before[0] in (None, signal.SIG_DFL) else before[0])
        os.write(writer, END)
        thread.join()
        os.close(reader)
        os.close(writer)


def _nothing(_: int, __: FrameType | None) -> None:
    """The handler in the main thread: without one the signal kills."""
