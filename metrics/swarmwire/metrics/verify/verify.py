"""Check a run folder: what is intact, what a killed run left, what is missing, what does not agree."""

from collections.abc import Callable, Collection, Mapping
from hashlib import file_digest
from pathlib import Path
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.record.names import DIGESTS, INPUTS, LOG, RECORDING, RUN_JSON, STATIC, SUMMARY
from swarmwire.metrics.record.part_files import scan_files
from swarmwire.metrics.record.tick_columns import ROBOT_COLUMNS
from swarmwire.metrics.run_folder import SCHEMAS, RunFolder
from swarmwire.metrics.table_file import corruption_errors
from swarmwire.metrics.verify.agreement import Verdict, events_agree, packets_agree, ticks_agree
from swarmwire.metrics.verify.finding import Finding, State
from swarmwire.metrics.verify.origin_check import check_digests, check_inputs, check_run_json
from swarmwire.metrics.verify.radio_agreement import distances_agree, links_agree, robots_agree
from swarmwire.metrics.verify.recording_check import check_recording
from swarmwire.metrics.verify.table_check import check_table
from swarmwire.metrics.verify.table_faults import table_fault

Agreement = Callable[[list[Path], Mapping[str, Any] | None], Verdict]
TABLES: dict[str, Agreement] = {
    "ticks": ticks_agree,
    "packets": packets_agree,
    "events": events_agree,
    "radio_robots": robots_agree,
    "radio_distances": distances_agree,
    "radio_links": links_agree,
}
COPIES = "copies of files"
ALWAYS = ("ticks", "events")  # recorded unless the summary says otherwise


def verify(path: Path | str) -> list[Finding]:
    """A finding for each part of a run folder; nothing is changed. BadInput if this is no run folder."""
    folder = RunFolder(path)
    parts = (SUMMARY, RUN_JSON, STATIC, LOG, RECORDING, *TABLES, *(f"{name}.parquet" for name in TABLES))
    if not any((folder.path / part).exists() for part in parts):
        raise BadInput(str(path), "", "expected a run folder; there is nothing of a run in it")
    summary, of_summary = _summary(folder)
    return [
        of_summary,
        _static(folder),
        *(_table(folder, name, summary) for name in TABLES),
        _recording(folder, summary),
        _log(folder),
        check_run_json(folder.path),
        *_told(DIGESTS, lambda: [check_digests(folder.path, summary)]),
        *_told(INPUTS, lambda: check_inputs(folder.path, summary)),
        *_told(COPIES, lambda: _copies(folder, summary)),
    ]


def _told(name: str, compared: Callable[[], list[Finding]]) -> list[Finding]:
    """What a comparison with the summary finds; a summary that is damaged further in than `RunFolder` looks differs."""
    try:
        return compared()
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OSError) as error:
        reason = " ".join(repr(error)[:60].split())
        return [Finding(name, State.DIFFERS, f"{SUMMARY} does not say what a run says there ({reason})")]
    except corruption_errors() as error:
        return [Finding(name, State.DAMAGED, str(error).splitlines()[0])]


def _summary(folder: RunFolder) -> tuple[dict[str, Any] | None, Finding]:
    try:
        summary = folder.summary
    except BadInput as error:
        return None, Finding(SUMMARY, State.DAMAGED, error.expected)
    if summary is None:
        return None, Finding(SUMMARY, State.MISSING, "the run did not end by itself, or still goes on")
    arenas = f", {summary['arenas']} arenas" if summary["arenas"] > 1 else ""
    text = f"ended: {summary['ended']}; {summary['ticks']} ticks ({summary['sim_time_s']:g} s){arenas}"
    return summary, Finding(SUMMARY, State.INTACT, text)


def _static(folder: RunFolder) -> Finding:
    if not (folder.path / STATIC).exists():
        return Finding(STATIC, State.MISSING, "without it rows have no robots' names")
    try:
        static = folder.static
    except BadInput as error:
        return Finding(STATIC, State.DAMAGED, error.expected)
    return Finding(STATIC, State.INTACT, f"{static.name}: {static.robots} robots, {static.rate_hz} Hz")


def _table(folder: RunFolder, name: str, summary: dict[str, Any] | None) -> Finding:
    found = check_table(folder.path, name, _columns(name))
    if found.state is State.MISSING:
        expected = name in (summary["record"] if summary else ALWAYS)
        return Finding(name, State.MISSING, found.text) if expected else Finding(name, State.NOT_RECORDED, "")
    if not found.files:
        return Finding(name, found.state, found.text)
    fault = _fault(folder, name, found.files)
    if fault is not None:
        return Finding(name, State.DAMAGED, fault)
    reach = "; ".join(part for part in (_reach(name, found.files), found.text) if part)

    def compared() -> list[Finding]:
        verdict = TABLES[name](found.files, summary) if found.state is not State.DAMAGED else None
        state, text = verdict or (found.state, "")
        return [Finding(name, state, f"{text}; {reach}" if text else reach)]

    return _told(name, compared)[0]


def _fault(folder: RunFolder, name: str, files: list[Path]) -> str | None:
    """What cannot be in its readable files, in words."""
    try:
        static = folder.static
    except BadInput:  # which has a finding of its own
        static = None
    try:
        return table_fault(name, scan_files(files), static)
    except corruption_errors() as error:  # parts of different types
        return str(error).splitlines()[0]


def _columns(name: str) -> Collection[str]:
    if name not in SCHEMAS:
        return ("tick", "time_s", "arena", *ROBOT_COLUMNS)
    return SCHEMAS[name]().keys()


def _reach(name: str, files: list[Path]) -> str:
    """How much a table holds, in words."""
    import polars as pl

    table, megabytes = scan_files(files), sum(file.stat().st_size for file in files) / 1e6
    rows = table.select(pl.len()).collect().item()
    text = f"{rows} rows, {megabytes:.1f} MB"
    if name == "ticks" and rows:
        tick, time_s = table.select(pl.col("tick").max(), pl.col("time_s").max()).collect().row(0)
        text += f", up to tick {tick} ({time_s:g} s)"
    return text


def _recording(folder: RunFolder, summary: dict[str, Any] | None) -> Finding:
    path = folder.path / RECORDING
    if not path.exists():
        return Finding(RECORDING, State.MISSING if summary and "rrd" in summary["record"] else State.NOT_RECORDED, "")
    return Finding(RECORDING, *check_recording(path, has_ticks=summary is None or summary["ticks"] > 0))


def _log(folder: RunFolder) -> Finding:
    path = folder.path / LOG
    if not path.exists():
        return Finding(LOG, State.MISSING, "what was said during the run")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        return Finding(LOG, State.DAMAGED, str(error))
    return Finding(LOG, State.INTACT if lines else State.DAMAGED, f"{len(lines)} lines")


def _copies(folder: RunFolder, summary: dict[str, Any] | None) -> list[Finding]:
    """Of each file that the summary lists, whether it is there and as it was."""
    findings: list[Finding] = []
    for copy in summary["files"] if summary else ():
        path = folder.path / copy["path"]
        if not path.is_file():
            findings.append(Finding(copy["path"], State.MISSING, "a file that the run used"))
            continue
        with path.open("rb") as file:
            same = file_digest(file, "sha256").hexdigest() == copy["sha256"]
        text = f"sha256 {copy['sha256'][:16]}…" if same else f"its sha256 is not {copy['sha256'][:16]}…"
        findings.append(Finding(copy["path"], State.INTACT if same else State.DIFFERS, text))
    return findings
