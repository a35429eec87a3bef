"""`swarmwire export`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

DEFAULT_NAME = "picture.png"

Run = Annotated[Path, typer.Argument(help="A run folder, of a run that goes on or was killed too.", metavar="RUN")]
To = Annotated[
    Path | None,
    typer.Option(
        help="The file. A picture: .png, .svg, .pdf. A film: .gif, .mp4. The radio's frames, for Wireshark: .pcapng. "
        "Metrics over time: .csv. Default: picture.png in RUN."
    ),
]
Kind = Annotated[
    str | None,
    typer.Option(
        help="Of a picture: arena, delivery (the share of receivers that received, over distance), or viewer (the "
        "recording as rerun's viewer shows it; needs a Vulkan driver). Default: arena."
    ),
]
At = Annotated[
    float | None, typer.Option("--at", help="Time of a picture, in s. Default: the end of the run.", metavar="S")
]
From = Annotated[float | None, typer.Option("--from", help="Start of what is exported, in s.", metavar="S")]
Until = Annotated[float | None, typer.Option("--until", help="End of what is exported, in s.", metavar="S")]
FramesPerS = Annotated[
    float | None,
    typer.Option(help="Frames per second of a film. Default: 10 (GIF), 25 (MP4), or one per tick if that is less."),
]
Speed = Annotated[
    float | None,
    typer.Option(help="Simulated seconds per second of a film. Default: 1, or more, for 300 frames at most."),
]
Arena = Annotated[int | None, typer.Option(help="Which of several arenas. Default: 0.")]
Metric = Annotated[
    list[str] | None,
    typer.Option(help="A metric beside the arena, or a column of the table. Repeatable. Default: up to three, or all."),
]
Size = Annotated[
    int | None, typer.Option(help="Longer side in pixels. Default: 1280 (pictures), 480 (GIF), 960 (MP4).")
]


def export_command(
    run: Run,
    to: To = None,
    kind: Kind = None,
    at_s: At = None,
    from_s: From = None,
    until_s: Until = None,
    fps: FramesPerS = None,
    speed: Speed = None,
    arena: Arena = None,
    metric: Metric = None,
    size: Size = None,
) -> None:
    """Export a run as a picture, a film, a capture of its radio or a table; the suffix of the file decides.

    Pictures and films need no screen. They show the arena, and metrics beside it; lines join robots that are in radio
    range and sight of one another, regardless of partitions and failed radios. A capture needs a run with packets
    recorded (--packets all).

      swarmwire export runs/first --to first.gif
      swarmwire export runs/first --to at-4s.png --at 4
    """
    from swarmwire.deploy.export import export
    from swarmwire.deploy.export.exporter import ExportOptions

    console = Console(highlight=False)
    target = to or run / DEFAULT_NAME
    options = ExportOptions(at_s, from_s, until_s, fps, speed, arena, metric or None, size, console)
    note = export(run, target, options, kind) or f"{target.stat().st_size / 1e6:.2g} MB"
    console.print(f"written: {target} ({note})", soft_wrap=True)
