"""`swarmwire export` and `draw`: files of a run, and pictures of what has not run."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.base.config import scenario_path
from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.exporters import DEFAULTS, EXPORTERS, ExportOptions, export
from swarmwire.deploy.cli.options import Overrides, Seed
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo

DEFAULT_NAME = "picture.png"
FILES = "; ".join(f"{', '.join(of.suffixes)}: {of.help}" for of in EXPORTERS if of in DEFAULTS)
KINDS = "; ".join(f"{of.name} ({', '.join(of.suffixes)}): {of.help}" for of in EXPORTERS if of not in DEFAULTS)

Run = Annotated[Path, typer.Argument(help="A run folder; the run may be live or killed.", metavar="RUN")]
To = Annotated[
    Path | None,
    typer.Option(help=f"The file, whose suffix selects its content. {FILES}. Default: picture.png in RUN."),
]
Kind = Annotated[
    str | None,
    typer.Option(help=f"Another content for the same suffix. {KINDS}. Default: arena."),
]
At = Annotated[
    float | None, typer.Option("--at", help="Time of a picture, in s. Default: the end of the run.", metavar="S")
]
From = Annotated[float | None, typer.Option("--from", help="Start of the exported part, in s.", metavar="S")]
Until = Annotated[float | None, typer.Option("--until", help="End of the exported part, in s.", metavar="S")]
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

    Pictures and films need no screen. They show the arena, and metrics beside it. If the run recorded packets
    (--packets all), lines are the packets that ended in the tick, each in the colour of its fate: received, lost,
    partitioned, … Without, lines join robots that are in radio range and sight of one another. A capture needs
    recorded packets.

      swarmwire export runs/first --to first.gif
      swarmwire export runs/first --to at-4s.png --at 4
    """
    console = TerminalConsole()
    target = to or run / DEFAULT_NAME
    options = ExportOptions(at_s, from_s, until_s, fps, speed, arena, metric or None, size, console)
    note = export(run, target, options, kind) or f"{target.stat().st_size / 1e6:.2g} MB"
    console.print(f"written: {target} ({note})", soft_wrap=True)


_ONLY_IN_BODIES = ("like", "drive", "radius_m")


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
    path = scenario_path(subject)
    if path.suffix != ".toml":
        written = to or Path(f"{subject}.png")
        _refuse_settings(seed, overrides)
        _draw_named_body(subject, written)
    else:
        written = to or Path(f"{path.stem}.png")
        if _is_sheet(path):
            _refuse_settings(seed, overrides)
            _draw_sheet(path, written)
        else:
            _draw_scenario(path, seed, overrides or [], written)
    echo(f"written: {written}")


def _draw_scenario(path: Path, seed: int | None, overrides: list[str], to: Path) -> None:
    from swarmwire.deploy.runs.config import RunConfig
    from swarmwire.deploy.runs.plan import make_plan
    from swarmwire.metrics.pictures.drawing.scenario import draw_scenario

    plan, world = make_plan(RunConfig(path, seed=seed, overrides=overrides))
    draw_scenario(plan.static, world.pose, plan.scenario.duration_s, to)


def _draw_named_body(name: str, to: Path) -> None:
    from swarmwire.comms.robot.bodies.body import body_names, load_body
    from swarmwire.metrics.pictures.drawing.bodies import draw_body

    if name not in body_names():
        raise BadInput(name, "", f"expected a scenario's or a body's .toml, or one of {', '.join(body_names())}")
    draw_body(load_body(name), to)


def _draw_sheet(path: Path, to: Path) -> None:
    from swarmwire.metrics.pictures.drawing.bodies import draw_body
    from swarmwire.world.scenario.bodies import read_body

    draw_body(read_body(path, str(path), ""), to)


def _is_sheet(path: Path) -> bool:
    """Whether the file describes a body; all else is for a scenario's reader, which refuses it if need be."""
    from swarmwire.comms.base.config import from_toml

    try:
        found = from_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False
    return "robots" not in found and any(key in found for key in _ONLY_IN_BODIES)


def _refuse_settings(seed: int | None, overrides: list[str] | None) -> None:
    for option, given in (("--seed", seed is not None), ("--set", bool(overrides))):
        if given:
            raise BadInput(option, "", "expected a scenario; a body has nothing to set")
