"""Where compiled kernels are kept: beside the code, else in the user's cache, else for as long as this process lives.

numba finds the first two by itself, and refuses to work where neither can be written: a container without a home, or
with a disk that is full or read-only.
"""

import atexit
import os
import shutil
import tempfile
from pathlib import Path

SET = "NUMBA_CACHE_DIR"
CODE = Path(__file__).parent


def keep_kernels() -> None:
    """See to it that there is a place, before anything is imported that has kernels."""
    if SET in os.environ or os.access(CODE, os.W_OK):
        return
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    try:
        (home / "numba").mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # there may be no home
        os.environ[SET] = tempfile.mkdtemp(prefix="sw-kernels-")  # also for processes that this one starts
        atexit.register(shutil.rmtree, os.environ[SET], ignore_errors=True)
