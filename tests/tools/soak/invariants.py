"""Invariants of every run, whatever happened to it: functions that raise Broken with the reason."""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from swarmwire.deploy import repeat
from swarmwire.deploy.runs.config import Replay
from swarmwire.deploy.runs.record.provenance import read_facts
from swarmwire.deploy.runs.record.replay_logs import read_live_events
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.metrics.records.run_folder.layout import SCENARIO
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.backends.runner_reports import NOT_READY

COMES = ("joined", "returned")
GOES = ("left", "lost")
SOMEBODY = "one of its own"


class Broken(Exception):
    """An invariant that does not hold."""


def check_fates(summary: Mapping[str, Any]) -> str:
    """Check that each packet has one fate for each intended receiver."""
    radio = summary["radio"]
    fates = sum(radio["fates"].values())
    if fates != radio["intended"]:
        raise Broken(f"the fates sum to {fates}, of {radio['intended']} intended receivers")
    return f"{fates} fates of {radio['intended']} intended receivers"


def check_owners(
    summary: Mapping[str, Any], robots: Iterable[str], *, all_played: bool = True, has_own_runners: bool = False
) -> str:
    """Each robot has one runner or, by `runner_events`, none; nobody takes what another has, or loses what is not his.

    `all_played` says that the run began with an agent for each robot, of which an open world tells. A run that
    `has_own_runners` does not record them.
    """
    owner: dict[str, str | None] = dict.fromkeys(robots, SOMEBODY if has_own_runners else None)
    begun = False
    for change in summary["runner_events"]:
        if change["tick"] >= 0 and not begun:
            begun = True
            if all_played and None in owner.values():
                raise Broken("it began with robots that nobody played")
        for robot in change["robots"]:
            if robot not in owner:
                raise Broken(f"{change['runner']} {change['what']} with {robot}, which is none")
            host = change["runner"].partition("/")[0]  # without the process of a host
            expected = None if change["what"] in COMES else host
            # A runner joins by its event only once its agents are ready; it may go, or restart a process, before that.
            unready = change["what"] in ("lost", "restarted") or change["reason"] == NOT_READY
            never_ready = unready and owner[robot] is None
            if owner[robot] not in (expected, SOMEBODY) and not never_ready:
                raise Broken(f"{change['runner']} {change['what']} {robot}, which {owner[robot] or 'nobody'} played")
            if change["what"] != "restarted":  # a process of its host
                owner[robot] = change["runner"] if change["what"] in COMES else None
    unowned = sum(runner is None for runner in owner.values())
    losses = sum(change["what"] in GOES for change in summary["runner_events"])
    counted = sum(summary["counts"].get(name, 0) for name in ("runners_lost", "runners_left"))
    if losses != counted:
        raise Broken(f"{losses} runners left or were lost, the counts say {counted}")
    return f"{len(owner) - unowned} robots played at the end, {unowned} without, after {losses} losses"


def check_folder(folder: Path) -> str:
    """Check that the run folder is complete, readable, and agrees with its summary."""
    parts = verify(folder)
    bad = [f"{part.part}: {part.state}, {part.text}" for part in parts if not part.good]
    if bad:
        raise Broken("; ".join(bad))
    return f"{len(parts)} parts of the folder whole"


def check_repeat(folder: Path) -> str:
    """Check that a repeat from the folder, with the recorded input, is equal bit for bit."""
    again = repeat(folder)
    if again.same is not True:
        raise Broken(f"repeat: same is {again.same}, first difference in tick {again.first_difference}")
    return f"repeated {again.result.ticks} ticks, the same"


def check_undisturbed(folder: Path) -> str:
    """Check that the run equals one without faults: same orders, agents in one process."""
    summary, origin = read_summary(folder), read_facts(folder)
    live_events, _ = read_live_events(folder)
    replay = Replay(summary["ticks"], None, live_events)
    simulation = Simulation(folder / SCENARIO, seeds=origin.seeds, replay=replay)
    got = run_to_end(simulation).trajectory_sha256
    if list(got) != list(summary["trajectory_sha256"]):
        raise Broken("the trajectory is not that of the run without faults")
    return f"{summary['ticks']} ticks as without faults"


def check_no_process(temporary: Path) -> str:
    """Check that no process of the run is alive, not even an orphan: its temporary files are in this folder."""
    if processes := processes_with(temporary):
        raise Broken(f"left: {'; '.join(processes)}")
    return "no process left"


def processes_with(temporary: Path) -> list[str]:
    """Process ids and commands of processes, but zombies, whose temporary files are in this folder."""
    processes: list[str] = []
    for process in psutil.process_iter():
        with suppress(psutil.Error):  # gone by now, or somebody else's
            if process.environ().get("TMPDIR") == str(temporary) and process.status() != psutil.STATUS_ZOMBIE:
                processes.append(f"{process.pid} {' '.join(process.cmdline())[:80]}")
    return processes


def check_no_file(temporary: Path, *, killed: bool = False) -> str:
    """No socket and no temporary folder is left; of a world that was `killed` its sockets are, which the next takes."""
    paths = [path for path in temporary.rglob("*") if not path.is_dir() or not any(path.iterdir())]
    files = [str(path.relative_to(temporary)) for path in paths]
    files = [path for path in files if path not in ("own", "own/swarmwire") and not (killed and path.startswith("sw-"))]
    if files:
        raise Broken(f"left among the temporary files: {', '.join(files[:5])} ({len(files)})")
    return "no socket or temporary file left"


def check_exit_codes(codes: Mapping[str, Mapping[str, int]]) -> str:
    """Check for exit codes without a crash: 0, 1, by request (130; -2 while Python starts), or killed (-9)."""
    allowed = {"0", "1", "130", "-2", "-9"}
    ends = [(who, code, times) for who, exit_counts in codes.items() for code, times in exit_counts.items()]
    strange = [f"{who} {code} ({times} times)" for who, code, times in ends if code not in allowed]
    if strange:
        raise Broken(", ".join(strange))
    return f"{sum(times for *_, times in ends)} processes ended, none by a crash"


def read_summary(folder: Path) -> Mapping[str, Any]:
    """The summary of a run that ended; Broken if there is none."""
    summary = RunFolder(folder).summary
    if summary is None:
        raise Broken("there is no summary")
    return summary
