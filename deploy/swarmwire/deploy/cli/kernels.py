"""`swarmwire kernels`: compile before the first run, and move compiled functions between machines."""

from pathlib import Path
from typing import Annotated

import typer

kernels_app = typer.Typer(
    help="Compiled functions: make them before the first run, and take them to other machines.", no_args_is_help=True
)
Archive = Annotated[Path, typer.Argument(help="A zip file of compiled functions.", metavar="FILE")]


@kernels_app.command("build")
def build_command(
    scenarios: Annotated[
        list[Path] | None,
        typer.Argument(help="Scenarios. Default: that of `swarmwire new`.", metavar="[SCENARIO]..."),
    ] = None,
) -> None:
    """Compile what the first two seconds of each scenario use, for all usual processors; its runs then start at once.

    On x86-64 that is level v3: Intel since 2013, AMD since 2015. Results are the same bits as by functions that a
    machine compiles for itself. For example, on one machine and then on another with the same swarmwire:

      swarmwire kernels build scenarios/flocking-lossy.toml

      swarmwire kernels export kernels.zip

      swarmwire kernels import kernels.zip
    """
    from swarmwire.deploy.cli.actions.kernels import build_kernels

    build_kernels(scenarios or [])


@kernels_app.command("export")
def export_command(archive: Archive) -> None:
    """Write the functions that `build` has compiled to a file."""
    from swarmwire.deploy.cli.actions.kernels import export_kernels

    export_kernels(archive)


@kernels_app.command("import")
def import_command(archive: Archive) -> None:
    """Take the functions of a file, if they fit this machine: versions of Python, numba and swarmwire, and processor.

    The file is code that runs on this machine: take it only from where you would install programs.
    """
    from swarmwire.deploy.cli.actions.kernels import import_kernels

    import_kernels(archive)
