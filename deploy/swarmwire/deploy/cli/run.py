"""The commands `run`, `repeat` and `exec`."""

from pathlib import Path
from typing import Annotated

import typer

from swarmwire.deploy.cli.options import with_options
from swarmwire.deploy.cli.run_options import RepeatOptions, RunCommandOptions
from swarmwire.deploy.machine import need_address_space


@with_options
def run_command(options: RunCommandOptions) -> None:
    """Run a scenario, show its progress, and write a run folder: summary, tables, recording, log.

    Without --realtime the same scenario and seed give the same run bit for bit, for all --runners and --threads.

    With --gateway robots act as real ones, in real time, for programs that drive them: swarmwire-agent, whose
    settings for each robot are written into the run folder, or any other that speaks the robot's protocol. For example:
    --gateway epuck2, or --gateway flock=ros2@tcp/127.0.0.1:7447.
    """
    need_address_space()  # before libraries are loaded, which may end the process if there is too little
    from swarmwire.deploy.cli.actions.run import run_scenario

    run_scenario(options)


@with_options
def repeat_command(options: RepeatOptions) -> None:
    """Repeat a run from its folder alone, and check whether the result is the same, bit for bit.

    For a campaign's folder, --run selects the run.

    Exit code 0: the same, as far as recorded; 1: different, or there is nothing to compare with; 2: the folder
    holds no run that can be repeated.
    """
    need_address_space()
    from swarmwire.deploy.cli.actions.repeat import repeat_run

    repeat_run(options)


def exec_command(
    run: Annotated[Path, typer.Argument(help="The folder of a run with network interfaces.", metavar="RUN")],
    robot: Annotated[str, typer.Argument(help="A robot of the run.", metavar="ROBOT")],
    command: Annotated[
        list[str] | None, typer.Argument(help="The command. Default: the user's shell.", metavar="COMMAND")
    ] = None,
) -> None:
    """Run a command on a robot of a running simulation: in its network namespace, for no longer than the run.

    For example: swarmwire exec RUN flock-0 -- ping flock-1. The robots' names are host names there.
    """
    from swarmwire.deploy.cli.actions.robot_shell import run_on_robot

    run_on_robot(run, robot, command)
