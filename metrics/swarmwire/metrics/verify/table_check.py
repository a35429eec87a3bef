"""A table of a run folder as it lies on disk: intact, in parts, damaged, or not there."""

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from swarmwire.metrics.record.part_files import part_file, parts_of, table_file
from swarmwire.metrics.table_file import corruption_errors
from swarmwire.metrics.verify.finding import State


@dataclass(frozen=True, slots=True)
class TableCheck:
    """The readable files of a table, and how it is as far as they tell."""

    state: State
    files: list[Path]
    text: str


def check_table(folder: Path, name: str, columns: Collection[str]) -> TableCheck:
    """Read every file of a table to its end, a column at a time; it must have at least these columns."""
    whole, parts = table_file(folder, name), parts_of(folder, name)
    if whole.exists():
        fault = _fault(whole, columns)
        if fault is None:
            # A run killed between the two leaves both; whoever reads takes the whole.
            return TableCheck(State.INTACT, [whole], "its parts were not cleared away" if parts else "")
        return TableCheck(State.DAMAGED, [], f"{whole.name}: {fault}")
    if not (folder / name).is_dir():
        return TableCheck(State.MISSING, [], f"there is neither {whole.name} nor a folder of its parts")
    faults = {part: fault for part in parts if (fault := _fault(part, columns)) is not None}
    for number, part in enumerate(parts):
        if part != part_file(folder, name, number):
            faults.setdefault(part, f"expected {part_file(folder, name, number).name} before it")
            break
    if faults:
        part, fault = next(iter(faults.items()))
        readable = [part for part in parts if part not in faults]
        return TableCheck(State.DAMAGED, readable, f"{len(faults)} of {len(parts)} parts; {name}/{part.name}: {fault}")
    text = f"{len(parts)} part{'s' if len(parts) != 1 else ''}, never joined" if parts else "nothing was on disk yet"
    return TableCheck(State.PARTIAL, parts, text)


def _fault(file: Path, columns: Collection[str]) -> str | None:
    import polars as pl

    try:
        there = pl.read_parquet_schema(file)
        missing = [column for column in columns if column not in there]
        if missing:
            return f"no column {missing[0]}"
        for column in there:
            pl.read_parquet(file, columns=[column])
    except (OSError, *corruption_errors()) as error:
        return str(error).splitlines()[0]
    return None
