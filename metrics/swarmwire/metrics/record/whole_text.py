"""Text files that are there whole or not at all."""

from pathlib import Path

from swarmwire.metrics.written_aside import written_aside


def write_whole(path: Path, text: str) -> None:
    """Write a file so that no half of it is ever seen; OSError if the disk will not."""
    with written_aside(path) as aside:
        aside.write_text(text, encoding="utf-8")
