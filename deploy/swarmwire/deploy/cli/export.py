"""The commands `export` and `draw`: files of a run; pictures of scenarios and bodies without a run."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.exporters import DEFAULTS, EXPORTERS, Exporter, ExportOptions
from swarmwire.deploy.cli.options import Overrides, Seed


def _suffixes(exporter: Exporter, *, by_default: bool) -> str:
    """Return the suffixes that select this exporter by default, or only together with its kind."""
    return ", ".join(suffix for suffix in exporter.suffixes if (DEFAULTS[suffix] == exporter) == by_default)


FILES = "; ".join(
    f"{suffixes}: {exporter.help}" for exporter in EXPORTERS if (suffixes := _suffixes(exporter, by_default=True))
)
KINDS = "; ".join(
    f"{exporter.name} ({suffixes}): {exporter.help}"
    for exporter in EXPORTERS
    if (suffixes := _suffixes(exporter, by_default=False))
)

RunFolder = Annotated[Path, typer.Argument(help="A run folder; the run may be live or killed.", metavar="RUN")]
TargetFile = Annotated[
    Path | None,
    typer.Option(help=f"The file, whose suffix selects its content. {FILES}. Default: picture.png in RUN."),
]
Kind = Annotated[
    str | None,
    typer.Option(help=f"Another content for the same suffix. {KINDS}. Default: arena, or metrics."),
]
Time = Annotated[
    float | None, typer.Option("--at", help="Time of a picture, in s. Default: the end of the run.", metavar="S")
]
StartTime = Annotated[float | None, typer.Option("--from", help="Start of the exported part, in s.", metavar="S")]
EndTime = Annotated[float | None, typer.Option("--until", help="End of the exported part, in s.", metavar="S")]
FramesPerS = Annotated[
    float | None,
    typer.Option(help="Frames per second of a film. Default: 10 (GIF), 25 (MP4), or one per tick if that is less."),
]
Speed = Annotated[
    float | None,
    typer.Option(help="Simulated seconds per second of a film. Default: 1, or more, for 300 frames at most."),
]
Arena = Annotated[int | None, typer.Option(help="Number of the arena. Default: 0.")]
Metric = Annotated[
    list[str] | None,
    typer.Option(
        help="A metric beside the arena, or a column of the table. Repeatable. Default: up to three, first those that "
        "the scenario lists; of a table all.",
        metavar="NAME",
    ),
]
Size = Annotated[
    int | None, typer.Option(help="Longer side in pixels. Default: 1280 (pictures), 480 (GIF), 960 (MP4).")
]
Origin = Annotated[
    str | None,
    typer.Option(
        help="Latitude and longitude (degrees) and height (m) of the arena's centre, for EMANE. Default: 0,0,0.",
        metavar="LAT,LON,ALT",
    ),
]


def export_command(
    run: RunFolder,
    to: TargetFile = None,
    kind: Kind = None,
    at_s: Time = None,
    from_s: StartTime = None,
    until_s: EndTime = None,
    fps: FramesPerS = None,
    speed: Speed = None,
    arena: Arena = None,
    metric: Metric = None,
    size: Size = None,
    origin: Origin = None,
) -> None:
    """Export a run as a picture, film, capture of its radio, recording, table or motion trace, by its suffix.

    Pictures and films need no screen. They show the arena, and metrics beside it. If the run recorded packets
    (--packets all), lines are the packets that ended in the tick, each in the colour of its fate: received, lost,
    partitioned, … Without, lines join robots that are in radio range and sight of one another. A capture needs
    recorded packets. A motion trace has a sample per robot and tick; a scenario can follow it.

      swarmwire export runs/first --to first.gif
      swarmwire export runs/first --to at-4s.png --at 4
      swarmwire export runs/first --to motion.csv --kind motion
    """
    from swarmwire.deploy.cli.actions.export import export_run

    options = ExportOptions(
        at_s=at_s,
        from_s=from_s,
        until_s=until_s,
        frames_per_s=fps,
        speed=speed,
        arena=arena,
        metrics=metric or None,
        size_px=size,
        origin=origin,
    )
    export_run(run, to, options, kind)


def draw_command(
    subject: Annotated[
        str,
        typer.Argument(
            help="A scenario or a body's data sheet, both TOML files, a swarm's folder, or a body's name.",
            metavar="WHAT",
        ),
    ],
    to: Annotated[
        Path | None, typer.Option(help="The picture: .png, .svg or .pdf. Default: NAME.png in this folder.")
    ] = None,
    seed: Seed = None,
    overrides: Overrides = None,
) -> None:
    """Draw a scenario as it starts, or a body with its sensors, without running anything.

    A scenario: arena, obstacles, lights, every robot at its start for the seed, and the radio's range.
    A body: to scale and from above, with wheels, rays and photocells, its figures and their source.
    """
    from swarmwire.deploy.cli.actions.draw import draw

    draw(subject, to, seed, overrides or [])
