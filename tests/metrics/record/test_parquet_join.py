import numpy as np
import polars as pl
import pytest

from swarmwire.metrics.record.parquet_join import MAGIC, TAIL_BYTES, join_files
from swarmwire.metrics.record.part_files import PARQUET
from swarmwire.metrics.record.thrift_compact import read_struct, written_struct

SCHEMA = {
    "tick": pl.Int64,
    "place": pl.Array(pl.Float32, 3),
    "state": pl.List(pl.String),
    "fate": pl.Enum(["heard", "lost"]),
    "value": pl.Float64,
    "alive": pl.Boolean,
}


def frame(first, rows):
    ticks = np.arange(first, first + rows)
    columns = {
        "tick": ticks,
        "place": np.stack([ticks, -ticks, ticks / 2], axis=1).astype(np.float32),
        "state": [["search", "home"][: tick % 3] for tick in ticks],
        "fate": [["heard", "lost", None][tick % 3] for tick in ticks],
        "value": [None if first == 0 else tick / 7 for tick in ticks],
        "alive": ticks % 2 == 0,
    }
    return pl.DataFrame(columns, schema=SCHEMA)


def written(folder, frames):
    parts = [folder / f"{number}.parquet" for number in range(len(frames))]
    for part, rows in zip(parts, frames, strict=True):
        rows.write_parquet(part, **PARQUET)
    return parts


@pytest.mark.parametrize("rows", [[5], [1, 700, 3], [2] * 40])
def test_the_rows_of_all_parts_are_read_in_order_whole_or_in_pieces(tmp_path, rows):
    frames = [frame(first, count) for first, count in zip(np.cumsum([0, *rows[:-1]]), rows, strict=True)]
    join_files(written(tmp_path, frames), tmp_path / "whole.parquet")
    expected = pl.concat(frames)
    assert pl.read_parquet(tmp_path / "whole.parquet").equals(expected)
    late = pl.scan_parquet(tmp_path / "whole.parquet").filter(pl.col("tick") >= sum(rows) - 2).select("state", "tick")
    assert late.collect().equals(expected.filter(pl.col("tick") >= sum(rows) - 2).select("state", "tick"))
    assert pl.scan_parquet(tmp_path / "whole.parquet").slice(sum(rows) - 1).collect().equals(expected[-1:])


def test_another_reader_finds_the_same_rows_in_as_many_row_groups_as_parts(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="comes with the extra [view]")
    frames = [frame(0, 10), frame(10, 300), frame(310, 1)]
    join_files(written(tmp_path, frames), tmp_path / "whole.parquet")
    file = parquet.ParquetFile(tmp_path / "whole.parquet")
    assert [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)] == [10, 300, 1]
    assert file.read().to_pylist() == pl.concat(frames).to_dicts()
    assert file.read_row_group(1).to_pylist() == frames[1].to_dicts()


def test_a_footer_is_written_as_it_was_read(tmp_path):
    (part,) = written(tmp_path, [frame(0, 50)])
    data = part.read_bytes()
    length = int.from_bytes(data[-TAIL_BYTES:-4], "little")
    footer = data[-TAIL_BYTES - length : -TAIL_BYTES]
    fields, end = read_struct(footer)
    assert end == len(footer)
    assert written_struct(fields) == footer


@pytest.mark.parametrize("broken", [b"", MAGIC, MAGIC + b"half of it", MAGIC + b"\xff\xff\xff\x7f" + MAGIC])
def test_a_broken_part_is_refused(tmp_path, broken):
    parts = written(tmp_path, [frame(0, 5), frame(5, 5)])
    parts[1].write_bytes(broken)
    with pytest.raises(ValueError, match=r"1\.parquet: expected a whole Parquet file"):
        join_files(parts, tmp_path / "whole.parquet")


def test_a_part_of_another_table_is_refused(tmp_path):
    parts = written(tmp_path, [frame(0, 5), frame(5, 5).drop("alive")])
    with pytest.raises(ValueError, match=r"1\.parquet: expected the columns of 0\.parquet"):
        join_files(parts, tmp_path / "whole.parquet")
