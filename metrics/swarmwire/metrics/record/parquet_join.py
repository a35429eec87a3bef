"""Parquet files of one table put one behind another: their bytes as they are, under one footer.

To read and compress the rows again, as writing a table does, takes three times as long as to write them in parts.
https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from swarmwire.metrics.record.thrift_compact import I16, Struct, read_struct, written_struct

MAGIC = b"PAR1"  # a file begins and ends with it
TAIL_BYTES = 8  # the footer's length, and the end
SCHEMA, ROWS, ROW_GROUPS = 2, 3, 4  # of the footer
COLUMNS, GROUP_OFFSET, ORDINAL = 1, 5, 7  # of a row group
CHUNK_OFFSET, CHUNK = 2, 3  # of a column in it
PAGE_INDEX = (4, 5, 6, 7)  # where pages are listed: not taken over, as that list has offsets, too, and none needs it
PAGE_OFFSETS = (9, 10, 11, 14)  # of a chunk: data, index, dictionary, Bloom filter


def join_files(parts: Sequence[Path], whole: Path) -> None:
    """Write the rows of the parts, in this order, as one file; ValueError if one is broken or of another table."""
    footer: Struct = {}
    groups: list[Struct] = []
    with whole.open("wb") as file:
        file.write(MAGIC)
        for part in parts:
            data = part.read_bytes()
            own, end = _footer(data, part)
            if footer and own[SCHEMA] != footer[SCHEMA]:
                raise ValueError(f"{part}: expected the columns of {parts[0].name}")
            for group in own[ROW_GROUPS][1][1]:
                groups.append(_moved(group, file.tell() - len(MAGIC), len(groups)))
            file.write(memoryview(data)[len(MAGIC) : end])
            kind, rows = own[ROWS]
            footer = {**own, ROWS: (kind, rows + (footer[ROWS][1] if footer else 0))}
        kind, (item, _) = footer[ROW_GROUPS]
        told = written_struct({**footer, ROW_GROUPS: (kind, (item, groups))})
        file.write(told + len(told).to_bytes(4, "little") + MAGIC)


def _footer(data: bytes, part: Path) -> tuple[Struct, int]:
    """The footer of a file, and where it begins."""
    length = int.from_bytes(data[-TAIL_BYTES:-4], "little")
    start = len(data) - TAIL_BYTES - length
    if data[:4] != MAGIC or data[-4:] != MAGIC or start < len(MAGIC):
        raise ValueError(f"{part}: expected a whole Parquet file")
    return read_struct(data, start)[0], start


def _moved(group: Struct, by: int, ordinal: int) -> Struct:
    """A row group whose bytes stand so much further behind."""
    kind, (item, columns) = group[COLUMNS]
    moved: list[Any] = []
    for column in columns:
        kept = {field: value for field, value in column.items() if field not in PAGE_INDEX}
        chunk_kind, chunk = kept[CHUNK]
        moved.append({**_shifted(kept, (CHUNK_OFFSET,), by), CHUNK: (chunk_kind, _shifted(chunk, PAGE_OFFSETS, by))})
    return {**_shifted(group, (GROUP_OFFSET,), by), COLUMNS: (kind, (item, moved)), ORDINAL: (I16, ordinal)}


def _shifted(fields: Struct, offsets: Sequence[int], by: int) -> Struct:
    return fields | {field: (fields[field][0], fields[field][1] + by) for field in offsets if field in fields}
