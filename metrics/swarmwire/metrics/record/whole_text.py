"""Text files that are there whole or not at all."""

from pathlib import Path

from swarmwire.metrics.record.part_files import ASIDE


def write_whole(path: Path, text: str) -> None:
    """Write a file aside first, then rename it, so that no half of it is ever seen; OSError if the disk will not."""
    aside = path.with_name(path.name + ASIDE)
    try:
        aside.write_text(text, encoding="utf-8")
        aside.replace(path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise
