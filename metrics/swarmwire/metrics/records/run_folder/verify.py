"""Verification of a run folder: its parts are intact, partial (of a killed run), missing, damaged or inconsistent."""

import hashlib
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import polars as pl

from swarmwire.comms.base.config import check_format, from_json
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import VIEW
from swarmwire.metrics.records.run_folder.layout import (
    DIGEST_BYTES,
    DIGESTS,
    INPUTS,
    LOG,
    RECORDING,
    RECORDING_END,
    RUN_FORMAT,
    RUN_JSON,
    STATIC,
    SUMMARY,
    complete_frames_bytes,
)
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.table import RecordedTable, TableState
from swarmwire.metrics.records.run_folder.tables import TABLES
from swarmwire.metrics.records.run_folder.writer import part_file, parts_of, scan_files, table_file
from swarmwire.metrics.records.table_file import corruption_errors

COPIES = "copies of files"


@dataclass(frozen=True, slots=True)
class Finding:
    """State of a part of a run folder, with one line of explanation."""

    part: str
    state: TableState
    text: str

    @property
    def good(self) -> bool:
        """True if the part has no fault."""
        return self.state in (TableState.INTACT, TableState.NOT_RECORDED)


def verify(path: Path | str) -> list[Finding]:
    """Return a finding for each part of a run folder, which is not changed; BadInput if this is no run folder."""
    folder = RunFolder(path)
    parts = (SUMMARY, RUN_JSON, STATIC, LOG, RECORDING, *TABLES, *(f"{name}.parquet" for name in TABLES))
    if not any((folder.path / part).exists() for part in parts):
        raise BadInput(str(path), "", "expected a run folder; there is nothing of a run in it")
    summary, summary_finding = _summary(folder)
    return [
        summary_finding,
        _static(folder),
        *(_table(folder, table, summary) for table in TABLES.values()),
        _recording(folder, summary),
        _log(folder),
        check_run_json(folder.path),
        *_compare(DIGESTS, lambda: [check_digests(folder.path, summary)]),
        *_compare(INPUTS, lambda: check_inputs(folder.path, summary)),
        *_compare(COPIES, lambda: _copies(folder, summary)),
    ]


def _compare(name: str, comparison: Callable[[], list[Finding]]) -> list[Finding]:
    """Run a comparison with the summary; report a summary that is damaged where `RunFolder` does not check."""
    try:
        return comparison()
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, OSError) as error:
        reason = " ".join(repr(error)[:60].split())
        return [Finding(name, TableState.DIFFERS, f"{SUMMARY} has unexpected content ({reason})")]
    except corruption_errors() as error:
        return [Finding(name, TableState.DAMAGED, str(error).splitlines()[0])]


def _summary(folder: RunFolder) -> tuple[dict[str, Any] | None, Finding]:
    try:
        summary = folder.summary
    except BadInput as error:
        return None, Finding(SUMMARY, TableState.DAMAGED, error.expected)
    if summary is None:
        return None, Finding(SUMMARY, TableState.MISSING, "the run was killed or is still running")
    arenas = f", {summary['arenas']} arenas" if summary["arenas"] > 1 else ""
    text = f"ended: {summary['ended']}; {summary['ticks']} ticks ({summary['sim_time_s']:g} s){arenas}"
    return summary, Finding(SUMMARY, TableState.INTACT, text)


def _static(folder: RunFolder) -> Finding:
    if not (folder.path / STATIC).exists():
        return Finding(STATIC, TableState.MISSING, "without it rows have no robots' names")
    try:
        static = folder.static
    except BadInput as error:
        return Finding(STATIC, TableState.DAMAGED, error.expected)
    return Finding(STATIC, TableState.INTACT, f"{static.name}: {static.robots} robots, {static.rate_hz} Hz")


def _table(folder: RunFolder, table: RecordedTable, summary: dict[str, Any] | None) -> Finding:
    name = table.name
    check = check_table(folder, table)
    if check.state is TableState.MISSING:
        expected = name in summary["record"] if summary else table.always
        return Finding(name, TableState.MISSING, check.text) if expected else Finding(name, TableState.NOT_RECORDED, "")
    if not check.files:
        return Finding(name, check.state, check.text)
    fault = _fault(folder, table, check.files)
    if fault is not None:
        return Finding(name, TableState.DAMAGED, fault)
    extent = "; ".join(part for part in (_extent(table, check.files), check.text) if part)

    def comparison() -> list[Finding]:
        verdict = table.compare(check.files, summary) if check.state is not TableState.DAMAGED else None
        state, text = verdict or (check.state, "")
        return [Finding(name, state, f"{text}; {extent}" if text else extent)]

    return _compare(name, comparison)[0]


def _fault(folder: RunFolder, table: RecordedTable, files: list[Path]) -> str | None:
    """Return wrong values or types in the table's readable files, in words."""
    try:
        static = folder.static
    except BadInput:  # the static part has a separate finding
        static = None
    try:
        return table.fault(scan_files(files), static)
    except corruption_errors() as error:  # parts of different types
        return str(error).splitlines()[0]


def _extent(table: RecordedTable, files: list[Path]) -> str:
    """Return rows, size and end of a table, in words."""
    lazy, megabytes = scan_files(files), sum(file.stat().st_size for file in files) / 1e6
    rows = lazy.select(pl.len()).collect().item()
    reach = table.reach(lazy) if rows else ""
    return f"{rows} rows, {megabytes:.1f} MB" + (f", {reach}" if reach else "")


def _recording(folder: RunFolder, summary: dict[str, Any] | None) -> Finding:
    path = folder.path / RECORDING
    if not path.exists():
        return Finding(
            RECORDING, TableState.MISSING if summary and "rrd" in summary["record"] else TableState.NOT_RECORDED, ""
        )
    return Finding(RECORDING, *check_recording(path, has_ticks=summary is None or summary["ticks"] > 0))


def _log(folder: RunFolder) -> Finding:
    path = folder.path / LOG
    if not path.exists():
        return Finding(LOG, TableState.MISSING, "the messages of the run")
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        return Finding(LOG, TableState.DAMAGED, str(error))
    return Finding(LOG, TableState.INTACT if lines else TableState.DAMAGED, f"{len(lines)} lines")


def _copies(folder: RunFolder, summary: dict[str, Any] | None) -> list[Finding]:
    """Return a finding for each copied file that the summary lists."""
    findings: list[Finding] = []
    for copy in summary["files"] if summary else ():
        path = folder.path / copy["path"]
        if not path.is_file():
            findings.append(Finding(copy["path"], TableState.MISSING, "a file that the run used"))
            continue
        with path.open("rb") as file:
            same = file_digest(file, "sha256").hexdigest() == copy["sha256"]
        text = f"sha256 {copy['sha256'][:16]}…" if same else f"its sha256 is not {copy['sha256'][:16]}…"
        findings.append(Finding(copy["path"], TableState.INTACT if same else TableState.DIFFERS, text))
    return findings


def check_run_json(folder: Path) -> Finding:
    """Check `run.json`."""
    try:
        content: object = from_json((folder / RUN_JSON).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Finding(RUN_JSON, TableState.MISSING, "without it the run cannot be repeated")
    except (OSError, ValueError) as error:
        return Finding(RUN_JSON, TableState.DAMAGED, str(error))
    try:
        check_format(content, RUN_FORMAT, str(folder / RUN_JSON))
    except BadInput as error:
        return Finding(RUN_JSON, TableState.DAMAGED, f"{error.key}: {error.expected}")
    match content:
        case {"seeds": list(), "ticks": int(ticks)}:
            return Finding(RUN_JSON, TableState.INTACT, f"{ticks} ticks planned")
        case _:
            expected = "expected the content that swarmwire writes at the start of a run"
            return Finding(RUN_JSON, TableState.DAMAGED, expected)


def check_digests(folder: Path, summary: Mapping[str, Any] | None) -> Finding:
    """Check that there is a digest for each tick, and that the last is that of the summary's hashes."""
    try:
        data = (folder / DIGESTS).read_bytes()
    except FileNotFoundError:
        return Finding(DIGESTS, TableState.MISSING, "without it a repetition cannot be compared tick by tick")
    except OSError as error:
        return Finding(DIGESTS, TableState.DAMAGED, str(error))
    ticks = len(data) // DIGEST_BYTES
    if summary is None:
        return Finding(DIGESTS, TableState.PARTIAL, f"{ticks} ticks")
    if len(data) != DIGEST_BYTES * summary["ticks"]:
        return Finding(DIGESTS, TableState.DIFFERS, f"{ticks} ticks; the summary has {summary['ticks']}")
    last = hashlib.sha256("".join(summary["trajectory_sha256"]).encode()).digest()[:DIGEST_BYTES]
    if ticks and data[-DIGEST_BYTES:] != last:
        return Finding(DIGESTS, TableState.DIFFERS, "the last is not that of the summary's hashes")
    return Finding(DIGESTS, TableState.INTACT, f"{ticks} ticks")


def check_inputs(folder: Path, summary: Mapping[str, Any] | None) -> list[Finding]:
    """Check the recorded inputs, if there are any."""
    recorded: Mapping[str, Any] | None = None if summary is None else summary["inputs"]
    path = folder / INPUTS
    if not path.is_file():
        if recorded is None:
            return []
        return [Finding(INPUTS, TableState.MISSING, "without it the run cannot be repeated")]
    with path.open("rb") as file:
        sha256 = hashlib.file_digest(file, "sha256").hexdigest()
    if recorded is None:
        state = TableState.PARTIAL if summary is None else TableState.DIFFERS
        return [Finding(INPUTS, state, f"{path.stat().st_size} bytes that the summary does not list")]
    if sha256 != recorded["sha256"]:
        return [Finding(INPUTS, TableState.DIFFERS, f"its sha256 is not {recorded['sha256'][:16]}…")]
    return [Finding(INPUTS, TableState.INTACT, f"{recorded['ticks']} ticks from {recorded['first_tick']} on")]


@dataclass(frozen=True, slots=True)
class TableCheck:
    """The readable files of a table, and the state that they show."""

    state: TableState
    files: list[Path]
    text: str


def check_table(run: RunFolder, table: RecordedTable) -> TableCheck:
    """Read every file of a table to its end, a column at a time, unless its types or size do not fit the run."""
    folder, name = run.path, table.name
    joined, parts = table_file(folder, name), parts_of(folder, name)
    if joined.exists():
        fault = _file_fault(run, table, joined)
        if fault is None:
            # A run killed while it removes the parts leaves both; readers use the joined file.
            return TableCheck(TableState.INTACT, [joined], "its parts were not removed" if parts else "")
        return TableCheck(TableState.DAMAGED, [], f"{joined.name}: {fault}")
    if not (folder / name).is_dir():
        return TableCheck(TableState.MISSING, [], f"there is neither {joined.name} nor a folder of its parts")
    faults = {part: fault for part in parts if (fault := _file_fault(run, table, part)) is not None}
    for number, part in enumerate(parts):
        if part != part_file(folder, name, number):
            faults.setdefault(part, f"expected {part_file(folder, name, number).name} before it")
            break
    if faults:
        part, fault = next(iter(faults.items()))
        readable = [part for part in parts if part not in faults]
        text = f"{len(faults)} of {len(parts)} parts; {name}/{part.name}: {fault}"
        return TableCheck(TableState.DAMAGED, readable, text)
    text = f"{len(parts)} part{'s' if len(parts) != 1 else ''}, never joined" if parts else "nothing was on disk yet"
    return TableCheck(TableState.PARTIAL, parts, text)


def _file_fault(run: RunFolder, table: RecordedTable, file: Path) -> str | None:
    try:
        schema = pl.read_parquet_schema(file)
        missing = [column for column in table.columns() if column not in schema]
        if missing:
            return f"no column {missing[0]}"
        fault = run.size_fault(table.name, pl.scan_parquet(file), [file])
        if fault is not None:
            return fault
        for column in schema:
            pl.read_parquet(file, columns=[column])
    except (OSError, *corruption_errors()) as error:
        return str(error).splitlines()[0]
    return None


def check_recording(path: Path, has_ticks: bool = True) -> tuple[TableState, str]:
    """Read a .rrd to its end, if rerun-sdk is installed; a run that `has_ticks` has one at least in its recording."""
    megabytes = f"{path.stat().st_size / 1e6:.1f} MB"
    if VIEW.missing():
        return TableState.INTACT, f"{megabytes}, not read: that needs {VIEW.requirement}"
    try:
        last, closed = _read_all(path)
    except Exception as error:  # noqa: BLE001 - rerun promises no type; whatever it is, the file is unreadable
        return TableState.DAMAGED, str(error).splitlines()[0]
    reach = "no tick in it" if last is None else f"up to tick {last}"
    if not closed:
        return TableState.PARTIAL, f"{megabytes}, readable {reach}; it was never closed"
    return TableState.PARTIAL if last is None and has_ticks else TableState.INTACT, f"{megabytes}, {reach}"


def _read_all(path: Path) -> tuple[int | None, bool]:
    """Call `_read`; if rerun refuses the file because its last frame is cut off, read up to that frame."""
    try:
        return _read(path)
    except RuntimeError as refused:
        with TemporaryDirectory() as folder, path.open("rb") as recording:
            start = Path(folder) / path.name
            start.write_bytes(recording.read(complete_frames_bytes(path)))
            try:
                return _read(start)[0], False
            except RuntimeError:
                raise refused from None  # the error about the file itself


def _read(path: Path) -> tuple[int | None, bool]:
    """Return the last tick in a recording, and True if it was closed: a closed one ends with RECORDING_END."""
    import rerun as rr

    last: int | None = None
    closed = False
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # rerun warns that a file without an index is of an old version
        for chunk in rr.chunk.RrdReader(str(path)).stream():
            last = max((tick for tick in (last, _last_tick(chunk)) if tick is not None), default=None)
            closed |= chunk.entity_path == f"/__properties/{RECORDING_END}"
    return last, closed


def _last_tick(chunk: Any) -> int | None:
    batch = chunk.to_record_batch()
    return max(batch["tick"].to_pylist(), default=None) if "tick" in batch.schema.names else None
