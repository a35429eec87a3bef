"""Recordings as the viewer opens them: that of a run that was killed has no end, and is completed in a copy."""

import os
import subprocess
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.viewer.screenshot import program

HEAD = b"RRF2"  # how a recording begins
FOOT = b"RRF2FOOT\x01\x00\x00\x00"  # and how a complete one ends


@contextmanager
def whole(recording: Path) -> Generator[Path]:
    """The recording, or a temporary copy that the viewer can open; BadInput if there is nothing to see in it."""
    if not recording.is_file():
        raise BadInput(str(recording), "", "there is no such recording")
    with recording.open("rb") as file:
        head = file.read(len(HEAD))
        file.seek(-min(len(FOOT), os.fstat(file.fileno()).st_size), os.SEEK_END)
        foot = file.read()
    if head != HEAD:
        raise BadInput(str(recording), "", "expected a recording (.rrd) with at least a tick in it")
    if foot == FOOT:
        yield recording
        return
    with TemporaryDirectory(prefix="swarmwire-view-") as directory:
        copy = Path(directory, recording.name)
        done = subprocess.run(
            [program(), "rrd", "optimize", recording, "-o", copy], capture_output=True, text=True, check=False
        )
        if done.returncode or not copy.is_file():
            raise BadInput(str(recording), "", f"expected a recording that can be read: {done.stderr[-500:].strip()}")
        yield copy
