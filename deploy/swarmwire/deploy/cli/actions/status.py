"""`swarmwire ctl status`: the status of live runs."""

import json
from contextlib import ExitStack, suppress
from typing import Any, NamedTuple

from swarmwire.deploy.cli.actions.control import control_of
from swarmwire.deploy.cli.options import RunChoice
from swarmwire.deploy.live.remote_control import controlling
from swarmwire.deploy.live.subscription import RunGone
from swarmwire.deploy.runs.live_address import find_run, live_runs
from swarmwire.deploy.terminal.console import TerminalConsole, aligned, print_rows
from swarmwire.deploy.terminal.output import echo

COLUMNS = ("run", "pid", "scenario", "tick", "state", "speed", "alive", "folder")


class RunStatus(NamedTuple):
    """The reply of a run to a request for its status, and its folder if the run is on this machine."""

    reply: dict[str, Any]
    folder: str | None


def print_status(choice: RunChoice, *, as_json: bool) -> None:
    """Print the status of the chosen run, or of all runs on this machine."""
    statuses = _statuses(choice)
    if as_json:
        for status in statuses:
            echo(json.dumps({**status.reply, "folder": status.folder}))
    elif not statuses:
        echo("no run of yours is live on this machine")
    elif len(statuses) > 1:
        print_rows(COLUMNS, list(map(_row, statuses)), TerminalConsole())
    else:
        _print_details(*statuses[0])


def _statuses(choice: RunChoice) -> list[RunStatus]:
    """Return the status of each chosen run, without those that end meanwhile."""
    if choice.endpoint is not None:
        with control_of(choice) as control:
            return [RunStatus(control.status(), None)]
    statuses: list[RunStatus] = []
    for run in live_runs() if choice.run is None else [find_run(choice.run)]:
        with ExitStack() as stack:
            if choice.run is None:
                stack.enter_context(suppress(RunGone))
            control = stack.enter_context(controlling(run.endpoint, run.run))
            statuses.append(RunStatus(control.status(), run.folder))
    return statuses


def _row(status: RunStatus) -> tuple[str, ...]:
    reply = status.reply
    return (
        reply["run"],
        str(reply["pid"]),
        reply["scenario"],
        f"{reply['tick']} of {reply['ticks']}",
        reply["state"],
        _speed(reply),
        f"{reply['alive']} of {reply['robots']}",
        status.folder or "",
    )


def _print_details(reply: dict[str, Any], folder: str | None) -> None:
    runners: dict[str, Any] = reply["runners"] or {}
    groups = ", ".join(f"{count} {name}" for name, count in reply["groups"].items())
    rows = [
        ("run", f"{reply['run']}, process {reply['pid']}"),
        ("scenario", f"{reply['scenario']}, seeds {reply['seeds']}"),
        ("folder", folder or ""),
        ("state", f"{reply['state']}, {_speed(reply)}"),
        ("tick", f"{reply['tick']} of {reply['ticks']} ({reply['time_s']:g} s)"),
        ("robots", f"{reply['alive']} of {reply['robots']} alive ({groups})"),
        ("runners", f"{runners['ready']} ready, {runners['lost']} lost" if runners else ""),
        ("waits", f"{runners['waits_s']:.0f} s for {runners['waits_for']}" if reply["state"] == "waiting" else ""),
        ("radio", _numbers(reply["radio"] or {})),
        ("metrics", _numbers({name: value for name, value in reply["metrics"].items() if value is not None})),
        ("counts", _numbers({name: count for name, count in reply["counts"].items() if count})),
        ("events", "; ".join(_event(event) for event in reply["events"] if not event["over"])),
    ]
    for line in aligned([row for row in rows if row[1]]):
        echo(line)


def _event(event: dict[str, Any]) -> str:
    return f"{event['number']}: {event['text']}" + (" (to come)" if event["tick"] is None else "")


def _numbers(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:g}" for name, value in values.items())


def _speed(reply: dict[str, Any]) -> str:
    speed = reply["speed"]
    if speed is None:
        return "as fast as possible"
    return f"{'real time ' if reply['real_time'] else 'at most '}x{speed:g}"
