"""`swarmwire draw`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.options import USUAL_SIZE_PX, Overrides, Seed

_ONLY_IN_BODIES = ("like", "drive", "radius_m")


def draw_command(
    subject: Annotated[
        str,
        typer.Argument(help="A scenario or a body's data sheet, both TOML files, or a body's name.", metavar="WHAT"),
    ],
    to: Annotated[
        Path | None, typer.Option(help="The picture: .png, .svg or .pdf. Default: NAME.png in this folder.")
    ] = None,
    seed: Seed = None,
    size: Annotated[int, typer.Option(help="Longer side in pixels.")] = USUAL_SIZE_PX,
    overrides: Overrides = None,
) -> None:
    """Draw a scenario as it starts, or a body with its sensors, without running anything.

    A scenario: arena, obstacles, lights, every robot where the seed puts it, and how far the radio reaches.
    A body: to scale and from above, with wheels, rays and photocells, its figures and their source.
    """
    path = Path(subject)
    if path.suffix != ".toml":
        written = to or Path(f"{subject}.png")
        _refuse_settings(seed, overrides)
        _draw_named_body(subject, written, size)
    else:
        written = to or Path(f"{path.stem}.png")
        if _is_sheet(path):
            _refuse_settings(seed, overrides)
            _draw_sheet(path, written, size)
        else:
            _draw_scenario(path, seed, overrides or [], written, size)
    typer.echo(f"written: {written}")


def _draw_scenario(path: Path, seed: int | None, overrides: list[str], to: Path, size_px: int) -> None:
    from swarmwire.deploy.simulation import Simulation
    from swarmwire.metrics.drawing.scenario import draw_scenario

    simulation = Simulation(path, seed=seed, overrides=overrides)
    draw_scenario(simulation.static, simulation.world.pose, simulation.scenario.duration_s, to, size_px)


def _draw_named_body(name: str, to: Path, size_px: int) -> None:
    from swarmwire.comms.bodies.body import body_names, load_body
    from swarmwire.metrics.drawing.bodies import draw_body

    if name not in body_names():
        raise BadInput(name, "", f"expected a scenario's or a body's .toml, or one of {', '.join(body_names())}")
    draw_body(load_body(name), to, size_px)


def _draw_sheet(path: Path, to: Path, size_px: int) -> None:
    from swarmwire.metrics.drawing.bodies import draw_body
    from swarmwire.world.scenario.bodies import read_body

    draw_body(read_body(path, str(path), ""), to, size_px)


def _is_sheet(path: Path) -> bool:
    """Whether the file describes a body; all else is for a scenario's reader, which refuses it if need be."""
    from swarmwire.comms.config import from_toml

    try:
        found = from_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return False
    return "robots" not in found and any(key in found for key in _ONLY_IN_BODIES)


def _refuse_settings(seed: int | None, overrides: list[str] | None) -> None:
    for option, given in (("--seed", seed is not None), ("--set", bool(overrides))):
        if given:
            raise BadInput(option, "", "expected a scenario; a body has nothing to set")
