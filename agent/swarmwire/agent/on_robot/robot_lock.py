"""The lock of a robot, and emergency stops that one process of this machine requests from another.

One process at a time drives a robot. It locks a file with `flock`, which the system releases as soon as the process is
gone, however it ended. The file contains the process id, followed by the result of the last requested emergency stop:
`STOPPED` or `OUT_OF_REACH`.

A request is a signal to the process that holds the lock; `stop_requests` handles it in a thread, and the requester
(`RobotLock.request_stop`) reads the result from the file.
"""

import fcntl
import hashlib
import os
import signal
import stat
import tempfile
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from swarmwire.agent.drivers.driver import Driver, DriverLost
from swarmwire.comms.base.clock import Clock, to_ns
from swarmwire.comms.base.errors import BadInput, SwarmwireError

STOPPED, OUT_OF_REACH = "stopped", "unreached"
STOP_SIGNAL = signal.SIGUSR1
CONFIRM_TIMEOUT_S = 2.0  # wait for the result of a requested stop
LOCK_TIMEOUT_S = 0.5  # wait for a lock that a requester or an ending process holds
POLL_NS = to_ns(0.02)
END = b"\0"  # ends the thread of stop requests; no signal has the number 0


class NotStopped(SwarmwireError):
    """The process that drives the robot did not confirm a requested stop."""


class RobotLock:
    """The lock of one robot, identified by its driver and address."""

    def __init__(self, kind: str, driver: Driver, clock: Clock) -> None:
        """Name the lock by the driver's name, `kind`, and its target; `clock` is the wall clock at any pace."""
        digest = hashlib.sha256(driver.target.encode()).hexdigest()[:16]
        self._name, self._clock = f"{kind}-{digest}.lock", clock
        self._description = f"the robot at {driver.address or driver.target}"
        self._file: int | None = None

    @contextmanager
    def acquire(self, where: str) -> Generator[None]:
        """Hold the lock within this context; BadInput at `driver.address` in `where` if another process holds it.

        BadInput also if no folder for locks is usable.
        """
        path = _folder() / self._name
        file = _open(path, os.O_RDWR | os.O_CREAT)
        try:
            if not self._try_lock(file, fcntl.LOCK_EX, LOCK_TIMEOUT_S):
                fault = f"{self._description} is driven by process {_holder(path) or 'unknown'} here"
                raise BadInput(where, "driver.address", f"expected a robot that no agent drives: {fault}")
            self._file = file
            self.write_result("")
            yield
            os.truncate(file, 0)
        finally:
            self._file = None
            fcntl.flock(file, fcntl.LOCK_UN)  # forked processes hold the lock as well, so closing would not release it
            os.close(file)

    def write_result(self, result: str) -> None:
        """Write the result of an emergency stop, STOPPED or OUT_OF_REACH, to the lock's file while it is held."""
        if self._file is not None:
            line = f"{os.getpid()} {result}\n".encode()
            os.pwrite(self._file, line, 0)
            os.truncate(self._file, len(line))

    def request_stop(self) -> int | None:
        """Request an emergency stop; return the process that drives the robot and stopped it, None without one.

        NotStopped without a confirmation within 2 s; BadInput if no folder for locks is usable, or this lock is not.
        """
        _folder()
        for folder in _folders():
            path = folder / self._name
            if _is_own_folder(folder) and path.exists():
                holder = self._request_stop_by(path)
                if holder is not None:
                    return holder
        return None

    def _request_stop_by(self, path: Path) -> int | None:
        """Request a stop by the holder of one lock file."""
        file = _open(path, os.O_RDONLY)
        try:
            begin_ns, signalled = self._clock.now_ns(), None
            while not self._try_lock(file, fcntl.LOCK_SH, 0.0):
                holder, result = _holder(path), _words(path)[1:]
                if holder and holder != signalled:
                    with suppress(ProcessLookupError):
                        os.kill(holder, STOP_SIGNAL)
                    signalled = holder
                elif holder and result == [STOPPED]:
                    return holder
                waited_ns = self._clock.now_ns() - begin_ns
                # Without a holder, only a dead agent's children have the lock; they cannot answer.
                if holder is None and waited_ns >= to_ns(LOCK_TIMEOUT_S):
                    return None
                if holder and waited_ns >= to_ns(CONFIRM_TIMEOUT_S):
                    raise NotStopped(self._unconfirmed(holder, result))
                self._clock.sleep_until(self._clock.now_ns() + POLL_NS)
            return None
        finally:
            os.close(file)

    def _unconfirmed(self, holder: int, result: list[str]) -> str:
        if result == [OUT_OF_REACH]:
            return f"process {holder} cannot reach {self._description}, and stops it as soon as it can"
        fault = f"did not confirm the stop within {CONFIRM_TIMEOUT_S:g} s"
        return f"process {holder} drives {self._description}, and {fault}"

    def _try_lock(self, file: int, operation: int, timeout_s: float) -> bool:
        """Lock the file, LOCK_EX or LOCK_SH; return False if another process holds it for longer than the timeout."""
        deadline_ns = self._clock.now_ns() + to_ns(timeout_s)
        while True:
            try:
                fcntl.flock(file, operation | fcntl.LOCK_NB)
            except BlockingIOError:
                if self._clock.now_ns() >= deadline_ns:
                    return False
                self._clock.sleep_until(self._clock.now_ns() + POLL_NS)
            except OSError as error:  # a file system without locks
                raise BadInput(self._name, "", f"expected a file that can be locked: {error.strerror}") from None
            else:
                return True


def _open(path: Path, flags: int) -> int:
    """Open a lock's file; BadInput if that fails."""
    try:
        return os.open(path, flags | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
    except OSError as error:
        raise BadInput(str(path), "", f"expected a file of this user's own, for a lock: {error.strerror}") from None


def _words(path: Path) -> list[str]:
    return path.read_text(encoding="ascii", errors="replace").split()


def _holder(path: Path) -> int | None:
    """Return the process in the lock's file, None if it does not run."""
    words = _words(path)
    if not words or not words[0].isdecimal():
        return None
    try:
        os.kill(int(words[0]), 0)
    except (ProcessLookupError, PermissionError):
        return None
    return int(words[0])


def _folders() -> list[Path]:
    """Return the folders for locks, the best first: a user's shells and services may have different variables.

    Runtime folders of other users, which `sudo` may pass on, are left out: a lock there would block its user.
    """
    user = os.getuid()
    runtime, usual = Path(os.environ.get("XDG_RUNTIME_DIR") or "/nonexistent"), Path(f"/run/user/{user}")
    runtimes = [runtime] if _is_own_folder(runtime.resolve()) else []
    runtimes += [usual] if usual != runtime and _is_own_folder(usual) else []
    folders = [folder / "swarmwire" for folder in runtimes]
    with suppress(OSError):  # a machine without a folder for temporary files
        folders.append(Path(tempfile.gettempdir()) / f"swarmwire-{user}")
    return folders


def _folder() -> Path:
    """Return the first folder that this user can use; BadInput without one."""
    faults = list[str]()
    for folder in _folders():
        fault = _fault(folder)
        if fault is None:
            return folder
        faults.append(f"{folder}: {fault}")
    raise BadInput("locks of robots", "", f"expected a folder of this user's own: {'; '.join(faults)}")


def _fault(folder: Path) -> str | None:
    """Create a folder, if missing; return the reason why it is not usable, None if it is."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        return error.strerror or str(error)
    return None if _is_own_folder(folder) else "is another user's, or a link"


def _is_own_folder(path: Path) -> bool:
    """Return True if the path is a folder of this user, and no link."""
    try:
        status = path.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid()


@contextmanager
def stop_requests(estop: Callable[[], None], report: Callable[[str], None]) -> Generator[None]:
    """Call `estop` at each stop signal within this context, and `report` with the result.

    A separate thread handles the signal: the interpreter writes signal numbers into a pipe at once, even while the
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
                    report(OUT_OF_REACH)
                else:
                    report(STOPPED)

    before = signal.signal(STOP_SIGNAL, _ignore), signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
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


def _ignore(_: int, __: FrameType | None) -> None:
    """Do nothing in the main thread, where the signal without a handler would kill the process."""
