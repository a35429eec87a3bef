"""`swarmwire ctl`: status, pace and end of live runs, from another terminal."""

import json
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarmwire.comms.base.errors import BadInput
from swarmwire.deploy.cli.catalogue.docstrings import flowing
from swarmwire.deploy.cli.options import AsJson, Certs, Endpoint, Insecure, Name
from swarmwire.deploy.terminal.output import echo

if TYPE_CHECKING:
    from swarmwire.comms.wire.network import Network
    from swarmwire.deploy.live.remote_control import FoundRun, RemoteControl


HELP = flowing("""Watch and control running simulations: pause, step, speed, and events for their robots and radios.

With several runs on this machine --run names one; `swarmwire ctl status` prints their ids and folders. Changes to a
run are recorded in its folder: `swarmwire repeat` makes them again, bit for bit.

For example:

  swarmwire ctl status
  swarmwire ctl pause
  swarmwire ctl step 10
  swarmwire ctl kill flock-3 --for 20
  swarmwire ctl set loss=0.6
  swarmwire ctl --run runs/flocking-s1-20261121T030405Z speed max
  swarmwire ctl --endpoint tls/10.0.0.5:7448 --certs lab-certs status
""")


ctl_app = typer.Typer(no_args_is_help=True)


@ctl_app.callback(help=HELP)
def _ctl(
    context: typer.Context,
    run: Annotated[
        str | None,
        typer.Option(help="The id of a run, the start of it, or its folder. Default: the only one.", metavar="RUN"),
    ] = None,
    endpoint: Endpoint = None,
    certs: Certs = None,
    name: Name = None,
    insecure: Insecure = False,
) -> None:
    context.obj = RunChoice(run, endpoint, certs, name, insecure)


@dataclass
class RunChoice:
    """What is said of the run before the command."""

    run: str | None = None  # its id, or its folder; None: the only one
    endpoint: str | None = None  # on another machine; None: a run of this one
    certs: Path | None = None
    name: str | None = None
    insecure: bool = False

    def network(self) -> "Network | None":
        """The settings for an endpoint beyond this machine; None for a run of this one. BadInput if they won't do."""
        if self.endpoint is None:
            if self.certs or self.name or self.insecure:
                raise BadInput("--endpoint", "", "is missing: certificates are for a run on another machine")
            return None
        from swarmwire.comms.wire.access_control import OPERATOR
        from swarmwire.deploy.robots.certificates.member import member

        of = member(OPERATOR, certs=self.certs, name=self.name, insecure=self.insecure)
        of.check("--endpoint", self.endpoint)
        if (warning := of.warning([self.endpoint])) is not None:
            echo(f"warning: {warning}", err=True)
        return of.network


@contextmanager
def control_of(chosen: RunChoice) -> "Generator[RemoteControl]":
    """Control over the run that is meant; BadInput if it is not clear which, RunGone if it does not answer."""
    from swarmwire.deploy.live.remote_control import controlling, find_run, only_run_at

    network = chosen.network()
    if chosen.endpoint is not None:
        run = chosen.run or only_run_at(chosen.endpoint, network)
        with controlling(chosen.endpoint, run, network) as control:
            yield control
        return
    found = find_run(chosen.run)
    with controlling(found.endpoint, found.run) as control:
        yield control


def runs_of_this_machine(chosen: RunChoice) -> "list[FoundRun]":
    """The runs that are meant, if they are this machine's: all, unless one is named."""
    from swarmwire.deploy.live.remote_control import find_run, found_runs

    return found_runs() if chosen.run is None else [find_run(chosen.run)]


COLUMNS = ("run", "pid", "scenario", "tick", "state", "speed", "alive", "folder")


def tell(reply: Mapping[str, Any]) -> None:
    """A line with what is done, and at which tick the run is."""
    echo(f"{reply['done']} (at tick {reply['tick']})")


@ctl_app.command("status")
def status_command(context: typer.Context, as_json: AsJson = False) -> None:
    """Print the status of a run, or a line for each of several runs on this machine.

    With --json there is a JSON object per run, each on a line. For example:

      swarmwire ctl status

      swarmwire ctl --run 3f2a status --json
    """
    chosen: RunChoice = context.obj
    told = _told(chosen)
    if as_json:
        for status, folder in told:
            echo(json.dumps({**status, "folder": folder}))
    elif not told:
        echo("no run of yours is live on this machine")
    elif len(told) > 1:
        _print_table(told)
    else:
        _print_one(*told[0])


def _told(chosen: RunChoice) -> list[tuple[dict[str, Any], str | None]]:
    """The status of each run that is meant, and its folder if it is known; those that end meanwhile are left out."""
    if chosen.endpoint is not None:
        with control_of(chosen) as control:
            return [(control.status(), None)]
    from swarmwire.deploy.live.following import RunGone
    from swarmwire.deploy.live.remote_control import controlling

    told: list[tuple[dict[str, Any], str | None]] = []
    for run in runs_of_this_machine(chosen):
        with ExitStack() as stack:
            if chosen.run is None:
                stack.enter_context(suppress(RunGone))
            told.append((stack.enter_context(controlling(run.endpoint, run.run)).status(), run.folder))
    return told


def _print_table(told: list[tuple[dict[str, Any], str | None]]) -> None:
    from swarmwire.deploy.terminal.console import TerminalConsole
    from swarmwire.deploy.terminal.tables import print_rows

    rows = [
        (
            status["run"],
            str(status["pid"]),
            status["scenario"],
            f"{status['tick']} of {status['ticks']}",
            status["state"],
            _speed(status),
            f"{status['alive']} of {status['robots']}",
            folder or "",
        )
        for status, folder in told
    ]
    print_rows(COLUMNS, rows, TerminalConsole())


def _print_one(status: dict[str, Any], folder: str | None) -> None:
    from swarmwire.deploy.terminal.tables import aligned

    runners: dict[str, Any] = status["runners"] or {}
    groups = ", ".join(f"{count} {name}" for name, count in status["groups"].items())
    rows = [
        ("run", f"{status['run']}, process {status['pid']}"),
        ("scenario", f"{status['scenario']}, seeds {status['seeds']}"),
        ("folder", folder or ""),
        ("state", f"{status['state']}, {_speed(status)}"),
        ("tick", f"{status['tick']} of {status['ticks']} ({status['time_s']:g} s)"),
        ("robots", f"{status['alive']} of {status['robots']} alive ({groups})"),
        ("runners", f"{runners['ready']} ready, {runners['lost']} lost" if runners else ""),
        ("waits", f"{runners['waits_s']:.0f} s for {runners['waits_for']}" if status["state"] == "waiting" else ""),
        ("radio", _numbers(status["radio"] or {})),
        ("metrics", _numbers({name: value for name, value in status["metrics"].items() if value is not None})),
        ("counts", _numbers({name: count for name, count in status["counts"].items() if count})),
        ("events", "; ".join(map(_event, (of for of in status["events"] if not of["over"])))),
    ]
    for line in aligned([row for row in rows if row[1]]):
        echo(line)


def _event(of: dict[str, Any]) -> str:
    return f"{of['number']}: {of['text']}" + (" (to come)" if of["tick"] is None else "")


def _numbers(of: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in of.items())


def _speed(status: dict[str, Any]) -> str:
    speed = status["speed"]
    return (
        "as fast as possible" if speed is None else f"{'real time ' if status['real_time'] else 'at most '}x{speed:g}"
    )


@ctl_app.command("pause")
def pause_command(context: typer.Context) -> None:
    """Pause the run at the end of the current tick, until `resume` or `step`.

    For example:

      swarmwire ctl pause
    """
    with control_of(context.obj) as control:
        tell(control.pause())


@ctl_app.command("resume")
def resume_command(context: typer.Context) -> None:
    """Resume a paused run.

    For example:

      swarmwire ctl resume
    """
    with control_of(context.obj) as control:
        tell(control.resume())


@ctl_app.command("step")
def step_command(
    context: typer.Context, ticks: Annotated[int, typer.Argument(help="Number of ticks.", min=1, metavar="N")] = 1
) -> None:
    """Run exactly N ticks, then pause.

    For example a second of a run with 10 ticks per second:

      swarmwire ctl step 10
    """
    with control_of(context.obj) as control:
        tell(control.step(ticks))


@ctl_app.command("speed")
def speed_command(
    context: typer.Context,
    factor: Annotated[str, typer.Argument(help="Simulated seconds per second, or max.", metavar="FACTOR|max")],
) -> None:
    """Set the speed: simulated seconds per second of wall time, or as fast as possible.

    For example at a tenth:

      swarmwire ctl speed 0.1

      swarmwire ctl speed max
    """
    with control_of(context.obj) as control:
        tell(control.speed(None if factor == "max" else _number(factor)))


@ctl_app.command("stop")
def stop_command(context: typer.Context) -> None:
    """End the run after the current tick, with its summary and tables.

    For example:

      swarmwire ctl stop
    """
    with control_of(context.obj) as control:
        tell(control.stop())


def _number(text: str) -> float:
    try:
        return float(text.removeprefix("x"))
    except ValueError:
        raise BadInput("FACTOR", "", f"expected a number such as 0.5, or max; got {text!r}") from None
