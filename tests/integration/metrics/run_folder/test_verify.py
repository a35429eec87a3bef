import json
import shutil
from hashlib import sha256

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.observe.truth import EventRecord
from swarmwire.comms.robot.packets import Fate
from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.records.run_folder import ticks, writer
from swarmwire.metrics.records.run_folder.events import EventLog
from swarmwire.metrics.records.run_folder.layout import RunLog
from swarmwire.metrics.records.run_folder.reader import RunFolder
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.tables import TABLES
from swarmwire.metrics.records.run_folder.verify import verify
from tests.support.metrics.recorded import links, made_up_summary, record, wandering
from tests.support.metrics.truths import static, tally, watch

TICKS, ARENAS = 10, 2
HASHES = ["a" * 64, "b" * 64]
DIGEST = sha256("".join(HASHES).encode()).digest()[:8]


def run_ticks(run):
    kill = EventRecord(0, 0.0, "kill", False, np.array([False, True, False] * ARENAS))
    ended = links([0, 0, 1], [1, 2, 0], [5, 5, 6], 1, arena=[0, 0, 1], fate=[Fate.RECEIVED, Fate.LOST, Fate.RECEIVED])
    counted = tally({Fate.RECEIVED: 1, Fate.LOST: 1, Fate.OUT_OF_RANGE: 3}, {Fate.RECEIVED: 1})
    yield from wandering(run, TICKS, events=(kill,), finished=ended, tally=counted)


def summarise(folder, run, recorded, **changes):
    """The summary of a run of these ticks, as deploy writes it."""
    parts = {}
    for observer in (Metrics(), RadioTally(), EventLog()):
        watch(run, run_ticks(run), observer)
        parts.update(observer.end(tally({Fate.IN_FLIGHT: 4}, {})))
    summary = made_up_summary(TICKS, arenas=ARENAS, record=recorded, trajectory_sha256=HASHES, **parts)
    (folder / "summary.json").write_text(json.dumps({**summary, **changes}))


def fill(folder, **changes):
    """A whole run folder, its summary changed by what is given."""
    run = static(3, arenas=ARENAS)
    recorded = record(folder, run, run_ticks(run), packets=changes.pop("share", 1.0))
    summarise(folder, run, changes.pop("record", recorded), **changes)
    log = RunLog(folder)
    log.append("begins")
    log.close()
    (folder / "run.json").write_text(json.dumps({"format": 1, "seeds": [1, 2], "ticks": TICKS}))
    (folder / "trajectory.digests").write_bytes(bytes(8 * (TICKS - 1)) + DIGEST)


@pytest.fixture(scope="module")
def undamaged(tmp_path_factory):
    fill(folder := tmp_path_factory.mktemp("whole"))
    return folder


@pytest.fixture
def folder(undamaged, tmp_path):
    """A copy of an undamaged run folder."""
    return shutil.copytree(undamaged, tmp_path, dirs_exist_ok=True)


def test_events_of_single_robots_are_counted_by_the_arenas_that_they_concern(folder):
    summary = json.loads((folder / "summary.json").read_text())
    path = folder / "events.parquet"
    table = pl.read_parquet(path)
    table.slice(1).write_parquet(path)
    assert states(folder) == {"events": TableState.DIFFERS}
    summary["events"][0] |= {"singly": True, "robots": [[], ["flock-1"]]}
    (folder / "summary.json").write_text(json.dumps(summary))
    assert states(folder) == {}


def states(folder):
    return {finding.part: finding.state for finding in verify(folder) if not finding.good}


def text_of(folder, part):
    return next(finding.text for finding in verify(folder) if finding.part == part)


def test_whole_run_folder_has_no_fault_and_is_unchanged_by_verify(folder):
    before = {path: path.read_bytes() for path in folder.rglob("*")}
    findings = verify(folder)
    assert all(finding.good for finding in findings)
    files = ("summary.json", "static.json", "log.txt", "run.json", "trajectory.digests", "run.rrd")
    assert {finding.part for finding in findings} == {*files, *TABLES}
    assert {finding.part for finding in findings if finding.state == TableState.NOT_RECORDED} == {
        "run.rrd",
        *({*TABLES} - {path.stem for path in folder.glob("*.parquet")}),
    }
    assert {"ticks", "packets", "events"} <= {
        finding.part for finding in findings if finding.state == TableState.INTACT
    }
    assert "20 rows" in text_of(folder, "ticks")
    assert "up to tick 9 (0.9 s)" in text_of(folder, "ticks")
    assert {path: path.read_bytes() for path in folder.rglob("*")} == before


def with_digests(path, state):
    """What is wrong if this alone is wrong with this file: without the summary nothing proves the digests."""
    without = {"trajectory.digests": TableState.PARTIAL} if path == "summary.json" else {}
    return {path.removesuffix(".parquet"): state, **without}


PARTS = ["summary.json", "static.json", "ticks.parquet", "packets.parquet", "events.parquet"]


@pytest.mark.parametrize("path", [*PARTS, "log.txt", "run.json", "trajectory.digests"])
def test_missing_file_of_a_run_folder_is_named(folder, path):
    (folder / path).unlink()
    assert states(folder) == with_digests(path, TableState.MISSING)


@pytest.mark.parametrize("path", PARTS)
@pytest.mark.parametrize("cut", [0.0, 0.5, 0.98])
def test_truncated_file_of_a_run_folder_is_damaged(folder, path, cut):
    data = (folder / path).read_bytes()
    (folder / path).write_bytes(data[: int(cut * len(data))])
    assert states(folder) == with_digests(path, TableState.DAMAGED)


def test_bytes_turned_over_within_a_table_are_found(folder):
    path = folder / "ticks.parquet"
    data = bytearray(path.read_bytes())
    for position in range(4, len(data) // 2):
        data[position] ^= 0xFF
    path.write_bytes(data)
    assert states(folder) == {"ticks": TableState.DAMAGED}


def killed(folder, monkeypatch, in_chunk=3):
    """A folder as a run leaves it that was killed: parts only."""
    monkeypatch.setattr(writer, "join_parts", lambda *_: None)
    monkeypatch.setattr(ticks, "MAX_TICKS", in_chunk)
    fill(folder)
    (folder / "summary.json").unlink()
    (folder / "ticks" / "part-000003.parquet").unlink()  # the last tick's


def test_killed_runs_tables_are_partial_up_to_their_last_part(tmp_path, monkeypatch):
    killed(tmp_path, monkeypatch)
    (tmp_path / "ticks" / ".aside-part-000003.parquet").write_bytes(b"PAR1 half of it")
    partial = dict.fromkeys(("ticks", "packets", "events", "trajectory.digests"), TableState.PARTIAL)
    assert states(tmp_path) == {"summary.json": TableState.MISSING, **partial}
    assert "up to tick 8 (0.8 s); 3 parts" in text_of(tmp_path, "ticks")


def test_killed_run_without_a_first_part_is_partial(tmp_path, monkeypatch):
    killed(tmp_path, monkeypatch)
    for part in (tmp_path / "ticks").iterdir():
        part.unlink()
    assert states(tmp_path)["ticks"] is TableState.PARTIAL


def test_parts_left_beside_the_whole_table_are_no_fault(folder):
    (folder / "ticks").mkdir()
    shutil.copy(folder / "ticks.parquet", folder / "ticks" / "part-000001.parquet")
    assert states(folder) == {}
    assert "parts" in text_of(folder, "ticks")


def test_damaged_or_missing_part_is_named(tmp_path, monkeypatch):
    killed(tmp_path, monkeypatch)
    broken = tmp_path / "ticks" / "part-000001.parquet"
    broken.write_bytes(broken.read_bytes()[:100])
    assert states(tmp_path)["ticks"] is TableState.DAMAGED
    assert "1 of 3 parts; ticks/part-000001.parquet" in text_of(tmp_path, "ticks")
    broken.unlink()
    assert states(tmp_path)["ticks"] is TableState.DAMAGED
    assert "part-000001.parquet" in text_of(tmp_path, "ticks")


def test_ticks_that_were_dropped_make_the_table_partial(folder):
    table = pl.read_parquet(folder / "ticks.parquet")
    table.filter(~pl.col("tick").is_in([4, 5])).write_parquet(folder / "ticks.parquet")
    assert states(folder) == {"ticks": TableState.PARTIAL}
    assert "2 ticks" in text_of(folder, "ticks")


@pytest.mark.parametrize(
    ("change", "part", "hints"),
    [
        ({"by_arena": made_up_summary(11, arenas=ARENAS)["by_arena"]}, "ticks", ("10 ticks", "11")),
        ({"events": []}, "events", ("20 rows", "0 events")),
        ({"metrics": [{"order": {"final": 2.0}}] * 2}, "ticks", ("order", "2.0")),
        ({"metrics": [{"speed": {"final": 2.0}}] * 2}, "ticks", ("speed",)),
        ({"radio": [{"fates": {"received": 11}}] * 2}, "packets", ("10 received (arena 0)", "11")),
        ({"metrics": [{"order": {}}] * 2}, "ticks", ("summary.json",)),
        ({"radio": [{"fates": 3}] * 2}, "packets", ("summary.json",)),
        ({"events": [1]}, "events", ("summary.json",)),
    ],
)
def test_tables_that_differ_from_the_summary_are_found(tmp_path, change, part, hints):
    fill(tmp_path, **change)
    assert states(tmp_path)[part] == TableState.DIFFERS
    assert all(hint in text_of(tmp_path, part) for hint in hints)


def test_missing_arena_in_a_table_is_found(folder):
    pl.read_parquet(folder / "ticks.parquet").filter(pl.col("arena") == 0).write_parquet(folder / "ticks.parquet")
    assert states(folder) == {"ticks": TableState.DIFFERS}


def test_fates_are_not_compared_where_packets_were_sampled_or_dropped_or_the_run_broken_off(tmp_path):
    other = {"radio": [{"fates": {"received": 11}}] * 2}
    rows = {"ticks": {"rows": 20, "dropped": 0}, "events": {"rows": 20, "dropped": 0}}
    for number, changes in enumerate(
        [
            {"share": 0.5},
            {"record": {**rows, "packets": {"rows": 1, "dropped": 2, "share": 1.0}}},
            {"ended": "interrupted"},
            {"ended": "failed"},  # a runner was lost amid a tick
            {"ended": "left"},
        ]
    ):
        folder = tmp_path / f"{number}"
        folder.mkdir()
        fill(folder, **other, **changes)
        assert states(folder) == {}


def test_copied_files_are_compared_with_their_sha256(tmp_path):
    (tmp_path / "agent.py").write_text("pass\n")
    listed = [{"path": "agent.py", "sha256": sha256(b"pass\n").hexdigest()}, {"path": "body.toml", "sha256": "0"}]
    fill(tmp_path, files=listed)
    assert states(tmp_path) == {"body.toml": TableState.MISSING}
    (tmp_path / "agent.py").write_text("fail\n")
    assert states(tmp_path) == {"agent.py": TableState.DIFFERS, "body.toml": TableState.MISSING}


def test_folder_without_a_run_is_refused_by_verify(tmp_path):
    for folder in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(BadInput, check=lambda error, folder=folder: error.where == str(folder)):
            verify(folder)


def test_recording_is_verified_to_its_end(folder):
    pytest.importorskip("rerun", reason="needs the extra [view]")
    from tests.support.metrics import recordings

    run = static(3)
    recordings.record(folder / "run.rrd", run, recordings.moving(run, 7))
    assert states(folder) == {}
    assert "up to tick 6" in text_of(folder, "run.rrd")
    data = (folder / "run.rrd").read_bytes()
    (folder / "run.rrd").write_bytes(data[: len(data) * 9 // 10])  # behind the layout of the views
    assert states(folder) == {"run.rrd": TableState.PARTIAL}
    assert "closed" in text_of(folder, "run.rrd")
    (folder / "run.rrd").write_bytes(b"no recording")
    assert states(folder) == {"run.rrd": TableState.DAMAGED}


def test_without_rerun_a_recording_is_only_seen(folder, monkeypatch):
    monkeypatch.setattr("swarmwire.comms.base.extras.find_spec", lambda _: None)
    shutil.copy(folder / "log.txt", folder / "run.rrd")
    assert "not read" in text_of(folder, "run.rrd")


@pytest.mark.parametrize(
    ("name", "content", "state"),
    [
        ("summary.json", b"{}", TableState.DAMAGED),
        ("summary.json", b"[]", TableState.DAMAGED),
        ("run.json", b"[]", TableState.DAMAGED),
        ("run.json", b"\xff", TableState.DAMAGED),
        ("log.txt", b"\xff\xfe", TableState.DAMAGED),
        ("trajectory.digests", DIGEST, TableState.DIFFERS),
        ("trajectory.digests", bytes(8 * TICKS), TableState.DIFFERS),
        *((name, None, TableState.DAMAGED) for name in ("summary.json", "run.json", "trajectory.digests", "log.txt")),
    ],
)
def test_file_with_other_contents_or_a_folder_in_its_place_is_found(folder, name, content, state):
    (folder / name).unlink()
    (folder / name).mkdir() if content is None else (folder / name).write_bytes(content)
    assert states(folder)[name] == state


def test_table_that_crashes_the_reader_is_damaged(folder, monkeypatch):
    def breaks(*_):
        raise pl.exceptions.PanicException("assertion failed: offset + length <= self.length")

    monkeypatch.setattr("swarmwire.metrics.records.run_folder.reader.scan_files", breaks)
    with pytest.raises(BadInput, match="ticks.*assertion failed.*swarmwire verify"):
        RunFolder(folder).ticks()
    monkeypatch.setattr(TABLES["ticks"], "compare", breaks)
    assert states(folder)["ticks"] == TableState.DAMAGED


def test_table_with_other_columns_is_damaged(folder):
    pl.DataFrame({"x": [1]}).write_parquet(folder / "packets.parquet")
    assert states(folder) == {"packets": TableState.DAMAGED}
    assert "no column" in text_of(folder, "packets")


def test_inputs_are_compared_with_the_summary(tmp_path):
    data = b"inputs"
    recorded = {"sha256": sha256(data).hexdigest(), "first_tick": 3, "ticks": 7}
    fill(tmp_path, inputs=recorded)
    assert states(tmp_path) == {"inputs/actions.frames": TableState.MISSING}
    (tmp_path / "inputs").mkdir()
    (tmp_path / "inputs" / "actions.frames").write_bytes(data)
    assert states(tmp_path) == {}
    (tmp_path / "inputs" / "actions.frames").write_bytes(data + b"!")
    assert states(tmp_path) == {"inputs/actions.frames": TableState.DIFFERS}


def test_recording_that_was_made_and_is_gone_is_missing(tmp_path):
    recorded = {"rows": TICKS, "dropped": 0}
    fill(tmp_path, share=0.0, record={"ticks": recorded, "events": recorded, "rrd": recorded})
    assert states(tmp_path) == {"run.rrd": TableState.MISSING}
