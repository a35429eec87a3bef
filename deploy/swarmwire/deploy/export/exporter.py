"""The interface of exporters: one kind of file that is made of a run folder."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console


@dataclass(frozen=True)
class ExportOptions:
    """Options of `swarmwire export`. None: the exporter's default."""

    at_s: float | None = None
    from_s: float | None = None
    until_s: float | None = None
    frames_per_s: float | None = None
    speed: float | None = None  # simulated seconds per second
    arena: int | None = None
    metrics: list[str] | None = None
    size_px: int | None = None  # longer side
    console: Console = field(default_factory=lambda: Console(quiet=True))  # for progress


FLAGS = {
    "at_s": "--at",
    "from_s": "--from",
    "until_s": "--until",
    "frames_per_s": "--fps",
    "speed": "--speed",
    "arena": "--arena",
    "metrics": "--metric",
    "size_px": "--size",
}


@dataclass(frozen=True)
class Exporter:
    """A kind of file.

    `write(run, to, options)` writes the file and returns a note on its content, such as `12 frames`, or an
    empty text. It raises BadInput for a run, a path or an option value that it cannot use, and then leaves no file.
    """

    name: str  # as `--kind` selects it
    suffixes: tuple[str, ...]
    options: frozenset[str]  # the fields of ExportOptions that it uses
    write: Callable[[Path, Path, ExportOptions], str]
