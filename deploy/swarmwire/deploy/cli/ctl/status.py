"""`swarmwire ctl status`."""

import json
from contextlib import ExitStack, suppress
from typing import Any

import typer

from swarmwire.deploy.cli.ctl.chosen_run import Chosen, control_of, runs_of_this_machine
from swarmwire.deploy.cli.options import AsJson

COLUMNS = ("run", "scenario", "tick", "state", "speed", "alive", "folder")


def status_command(context: typer.Context, as_json: AsJson = False) -> None:
    """Tell how a run is doing; of several runs on this machine, a line each.

    With --json there is a JSON object per run, each on a line. For example:

      swarmwire ctl status

      swarmwire ctl 3f2a status --json
    """
    chosen: Chosen = context.obj
    told = _told(chosen)
    if as_json:
        for status, folder in told:
            typer.echo(json.dumps({**status, "folder": folder}))
    elif not told:
        typer.echo("no run of yours goes on on this machine")
    elif len(told) > 1:
        _print_table(told)
    else:
        _print_one(*told[0])


def _told(chosen: Chosen) -> list[tuple[dict[str, Any], str | None]]:
    """The status of each run that is meant, and its folder if it is known; those that end meanwhile are left out."""
    if chosen.endpoint is not None:
        with control_of(chosen) as control:
            return [(control.status(), None)]
    from swarmwire.deploy.control.remote_control import controlling
    from swarmwire.deploy.live.following import RunGone

    told: list[tuple[dict[str, Any], str | None]] = []
    for run in runs_of_this_machine(chosen):
        with ExitStack() as stack:
            if chosen.run is None:
                stack.enter_context(suppress(RunGone))
            told.append((stack.enter_context(controlling(run.endpoint, run.run)).status(), run.folder))
    return told


def _print_table(told: list[tuple[dict[str, Any], str | None]]) -> None:
    from rich.console import Console

    from swarmwire.deploy.terminal.rows import print_rows

    rows = [
        (
            status["run"],
            status["scenario"],
            f"{status['tick']} of {status['ticks']}",
            status["state"],
            _speed(status),
            f"{status['alive']} of {status['robots']}",
            folder or "",
        )
        for status, folder in told
    ]
    print_rows(COLUMNS, rows, Console(highlight=False))


def _print_one(status: dict[str, Any], folder: str | None) -> None:
    from swarmwire.deploy.terminal.rows import aligned

    runners: dict[str, Any] = status["runners"] or {}
    groups = ", ".join(f"{count} {name}" for name, count in status["groups"].items())
    rows = [
        ("run", status["run"]),
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
        ("events", "; ".join(f"{of['number']}: {of['text']}" for of in status["events"] if not of["over"])),
    ]
    for line in aligned([row for row in rows if row[1]]):
        typer.echo(line)


def _numbers(of: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in of.items())


def _speed(status: dict[str, Any]) -> str:
    speed = status["speed"]
    return (
        "as fast as possible" if speed is None else f"{'real time ' if status['real_time'] else 'at most '}x{speed:g}"
    )
