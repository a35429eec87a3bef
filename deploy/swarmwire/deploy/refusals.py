"""What the machine refuses: disk, files, memory, processes. No fault of the program, so a line and no traceback."""

import errno

CURES = {
    errno.ENOSPC: "make room: df -h",
    errno.EDQUOT: "make room: quota",
    errno.EFBIG: "raise the limit: ulimit -f",
    errno.EMFILE: "raise the limit: ulimit -n",
    errno.ENFILE: "raise the limit of the system: fs.file-max",
    errno.ENOMEM: "fewer robots, seeds or runners need less",
    errno.EAGAIN: "raise the limit of processes and threads, ulimit -u, or of memory, ulimit -v",
    errno.EROFS: "choose another folder",
    errno.EIO: "the disk may be worn out",
}
NO_THREAD = "can't start new thread"  # of Python's threads


def refusal(error: BaseException) -> str | None:
    """What the machine refused, with what can be done about it, in a line; None for any other error."""
    if isinstance(error, MemoryError):
        return f"no memory is left: {error}".removesuffix(": ") + f" ({CURES[errno.ENOMEM]})"
    if isinstance(error, RuntimeError) and NO_THREAD in str(error):
        return f"no thread can be started ({CURES[errno.EAGAIN]})"
    if isinstance(error, OSError) and error.errno in CURES:
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror} ({CURES[error.errno]})"
    return None
