"""Tables are written in parts and joined at the end; files are there whole or not at all; damaged ones are named."""

import errno
from io import BytesIO
from pathlib import Path
from threading import Event

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.base.atomic import output_file
from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import BadInput, RecordFailed
from swarmwire.metrics.records.run_folder import writer
from swarmwire.metrics.records.run_folder.layout import RunLog
from swarmwire.metrics.records.run_folder.writer import (
    MAX_QUEUED_CHUNKS,
    PARQUET,
    Chunk,
    ChunkLimit,
    TableWriter,
    join_parts,
    parts_of,
    write_file,
)
from swarmwire.metrics.records.table_file import read_parquet, refuse_corrupt
from tests.support.clocks import StillClock
from tests.support.metrics.recorded import damaged
from tests.support.refusals import refused_input

SCHEMA = {"number": pl.Int64, "name": pl.String}


def chunk(first, rows=10):
    frame = pl.DataFrame({"number": range(first, first + rows), "name": [f"n{first}"] * rows}, schema=SCHEMA)
    return Chunk(rows, lambda: frame)


def put_many(writer, parts):
    for part in range(parts):
        writer.put(chunk(10 * part))


@pytest.mark.parametrize("parts", [0, 1, 2, 7])
def test_parts_become_one_table_in_order_and_are_removed(tmp_path, parts):
    writer = TableWriter(tmp_path, "rows", SCHEMA)
    put_many(writer, parts)
    writer.close()
    table = pl.read_parquet(tmp_path / "rows.parquet")
    assert table.schema == pl.Schema(SCHEMA)
    assert table["number"].to_list() == list(range(10 * parts))
    assert [path.name for path in tmp_path.iterdir()] == ["rows.parquet"]
    assert (writer.rows, writer.dropped) == (10 * parts, 0)


def test_parts_leave_no_trace_in_the_joined_table(tmp_path):
    pyarrow_parquet = pytest.importorskip("pyarrow.parquet", reason="comes with the extra [view]")
    writer = TableWriter(tmp_path, "rows", SCHEMA)
    put_many(writer, 5)
    writer.close()
    assert pyarrow_parquet.ParquetFile(tmp_path / "rows.parquet").metadata.num_row_groups == 1


def test_until_the_end_there_are_numbered_parts_and_nothing_half_written(tmp_path):
    writer = TableWriter(tmp_path, "rows", SCHEMA)
    put_many(writer, 3)
    written = Event()
    writer.put(Chunk(0, lambda: written.set() or pl.DataFrame(schema=SCHEMA)))
    assert written.wait(30)
    assert sorted(path.name for path in (tmp_path / "rows").iterdir()) == [f"part-00000{i}.parquet" for i in range(3)]
    assert pl.read_parquet(parts_of(tmp_path, "rows"))["number"].to_list() == list(range(30))
    writer.close()


def held(release):
    """A chunk that keeps the thread busy until the test lets it go."""
    begun = Event()

    def frame():
        begun.set()
        assert release.wait(30)
        return chunk(0).frame()

    return begun, Chunk(10, frame)


def test_with_a_full_queue_chunks_are_dropped_and_their_rows_counted(tmp_path):
    release, writer = Event(), TableWriter(tmp_path, "rows", SCHEMA, may_drop=True)
    begun, busy = held(release)
    writer.put(busy)
    assert begun.wait(30)
    for part in range(1, 1 + MAX_QUEUED_CHUNKS + 3):
        writer.put(chunk(10 * part))
    assert writer.dropped == 30
    release.set()
    writer.close()
    assert writer.rows == 10 * (1 + MAX_QUEUED_CHUNKS)
    assert pl.read_parquet(tmp_path / "rows.parquet")["number"].to_list() == list(range(writer.rows))


def test_full_queue_in_lockstep_blocks_the_loop_and_drops_nothing(tmp_path):
    release, writer = Event(), TableWriter(tmp_path, "rows", SCHEMA)
    begun, busy = held(release)
    writer.put(busy)
    assert begun.wait(30)
    for part in range(1, 1 + MAX_QUEUED_CHUNKS):
        writer.put(chunk(10 * part))
    original, was_full = writer._queue.put, []

    def put(item):  # would wait for ever in a queue that is full, if nobody let the thread go on
        was_full.append(writer._queue.full())
        release.set()
        original(item)

    writer._queue.put = put
    writer.put(chunk(10 * (1 + MAX_QUEUED_CHUNKS)))
    writer.close()
    assert was_full[0]
    assert (writer.rows, writer.dropped) == (10 * (2 + MAX_QUEUED_CHUNKS), 0)


def refuse_after(monkeypatch, files):
    """From then on the disk is full."""
    numbers = iter(range(files))

    def full(frame, path):
        if next(numbers, None) is None:
            raise OSError(28, "No space left on device")
        write_file(frame, path)

    monkeypatch.setattr(writer, "write_file", full)


def test_full_disk_is_reported_at_the_next_put_and_written_parts_stay(tmp_path, monkeypatch):
    refuse_after(monkeypatch, 2)
    writer = TableWriter(tmp_path, "rows", SCHEMA)
    with pytest.raises(RecordFailed, match="rows: .*No space left"):
        put_many(writer, 100)
    with pytest.raises(RecordFailed, match="No space left"):
        writer.close()
    assert not writer._thread.is_alive()
    assert pl.read_parquet(parts_of(tmp_path, "rows"))["number"].to_list() == list(range(20))
    assert writer.rows == 20
    assert writer.dropped >= 10


def test_join_that_fails_leaves_the_parts(tmp_path):
    (tmp_path / "rows").mkdir()
    for part in range(3):
        write_file(chunk(10 * part).frame(), tmp_path / "rows" / f"part-00000{part}.parquet")
    (tmp_path / "rows" / "part-000001.parquet").write_bytes(b"PAR1 and no more")
    with pytest.raises(pl.exceptions.PolarsError):
        join_parts(tmp_path, "rows")
    assert [path.name for path in tmp_path.iterdir()] == ["rows"]
    assert len(parts_of(tmp_path, "rows")) == 3


def test_frame_that_cannot_be_written_leaves_no_temporary_file(tmp_path):
    with pytest.raises(OSError):
        write_file(pl.DataFrame({"a": np.arange(3)}), tmp_path / "nowhere" / "a.parquet")
    assert list(tmp_path.iterdir()) == []


def times_due(limit: ChunkLimit, clock: StillClock, seconds: int) -> list[int]:
    """When chunks that stay small are due."""
    due: list[int] = []
    for second in range(1, seconds + 1):
        clock.time_ns += NS_PER_S
        if limit.reached(0):
            due.append(second)
            limit.restart()
    return due


def test_chunk_that_is_large_is_due_at_once() -> None:
    limit = ChunkLimit(10, StillClock())
    assert not limit.reached(9)
    assert limit.reached(10)


def test_chunk_that_is_small_is_due_every_two_seconds() -> None:
    clock = StillClock()
    assert times_due(ChunkLimit(10, clock), clock, 1000) == list(range(2, 1001, 2))


class Noon:
    def utc_stamp(self):
        return "20261121T120000Z"


def test_log_has_each_text_at_once_with_its_time(tmp_path):
    log = RunLog(tmp_path, Noon())
    log.append("begins")
    log.append("observer X failed:\nTraceback\nOSError\n")
    assert (tmp_path / "log.txt").read_text().splitlines() == [
        "20261121T120000Z begins",
        "20261121T120000Z observer X failed:",
        "    Traceback",
        "    OSError",
    ]
    log.close()
    log.close()


def test_log_that_cannot_be_written_counts_its_lines_and_raises_nothing(tmp_path):
    (tmp_path / "log.txt").symlink_to("/dev/full")
    log = RunLog(tmp_path, Noon())
    log.append("one")
    log.append("two")
    assert log.lost == 2
    log.close()


def full(to):
    with output_file(to) as aside:
        aside.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")


def test_output_file_on_a_full_disk_is_refused_and_the_old_one_stays(tmp_path):
    to = tmp_path / "page.html"
    to.write_text("before")
    with pytest.raises(BadInput, match="page.html: .*No space left on device"):
        full(to)
    assert to.read_text() == "before"
    assert list(tmp_path.iterdir()) == [to]


def test_output_file_passes_on_other_errors_and_leaves_nothing(tmp_path):
    with pytest.raises(FileNotFoundError), output_file(tmp_path / "page.html"):
        (tmp_path / "missing").read_text()
    assert list(tmp_path.iterdir()) == []


FRAME = pl.DataFrame({"run": [0, 0, 1, 1], "order": [0.5, None, 0.25, 1.0], "ended": ["stopped", "failed", "", "é"]})


def parquet(frame: pl.DataFrame) -> bytes:
    file = BytesIO()
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


def refusal(file: Path) -> str | None:
    """What is said of the file; None: it can be read."""
    try:
        read_parquet(file, advice="take it away")
    except BadInput as error:
        return str(error)
    return None


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("RUST_BACKTRACE", "0")  # to name the functions of a panic takes seconds
        yield tmp_path_factory.mktemp("damaged") / "part.parquet"


@settings(max_examples=60)
@given(data=damaged(parquet(FRAME)))
def test_damaged_parquet_is_read_or_refused_in_one_line_with_its_name(file, data):
    file.write_bytes(data)
    error = refusal(file)
    if error is not None:
        assert error.startswith(f"{file}: ")
        assert error.endswith("take it away")
        assert "\n" not in error


def test_polars_panic_is_refused_with_the_file(file, monkeypatch):
    def panics(*_, **__):
        raise pl.exceptions.PanicException("called `Result::unwrap()` on an `Err` value")

    monkeypatch.setattr(pl, "read_parquet", panics)
    with refused_input(file):
        read_parquet(file)


def test_missing_parquet_is_refused_with_its_name(tmp_path):
    with pytest.raises(BadInput, match="none.parquet: .*No such file"):
        read_parquet(tmp_path / "none.parquet")


@given(index=st.integers(0, 2), how=st.sampled_from([parquet(FRAME)[:-1], parquet(FRAME.cast({"order": pl.String}))]))
def test_damaged_file_among_several_is_named_or_that_of_other_types(file, index, how):
    files = [file.with_name(f"{number}.parquet") for number in range(3)]
    for each in files:
        each.write_bytes(parquet(FRAME))
    refuse_corrupt(files)
    files[index].write_bytes(how)
    # Where the first is of other types than the rest, it is the second that differs from what came before.
    with refused_input(files[index] if index or how.endswith(b"PAR") else files[1]):
        refuse_corrupt(files)
