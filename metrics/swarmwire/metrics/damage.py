"""Parquet files that are damaged, as a power cut may leave them: what polars raises, and how people are told."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput

if TYPE_CHECKING:
    import polars as pl


def damage() -> tuple[type[BaseException], ...]:
    """Its errors, and its panics: a damaged Parquet file may break what its own code takes for granted.

    A panic is no Exception. polars tells of it on stderr, and goes on.
    """
    import polars as pl

    return (pl.exceptions.PolarsError, pl.exceptions.PanicException)


def read_whole(file: Path, columns: list[str] | None = None, cure: str = "") -> "pl.DataFrame":
    """What a Parquet file holds; BadInput names it if it is damaged or cannot be read, with what can be done."""
    import polars as pl

    try:
        return pl.read_parquet(file, columns=columns)
    except (OSError, *damage()) as error:
        panic = isinstance(error, pl.exceptions.PanicException)
        why = "polars gave up on it" if panic else str(error).partition("\n")[0]
        raise BadInput(str(file), "", f"expected a whole Parquet file: {why}{cure and '; '}{cure}") from None


def refuse_damaged(files: Iterable[Path], cure: str = "") -> None:
    """BadInput for the first of these Parquet files that is damaged, or has a column of another type than one before.

    For where reading them together failed, which does not tell of which it did.
    """
    kinds: dict[str, pl.DataType] = {}
    for file in files:
        for name, kind in read_whole(file, cure=cure).schema.items():
            if kinds.setdefault(name, kind) != kind:
                expected = f"expected {kinds[name]} as in the files before it, got {kind}"
                raise BadInput(str(file), name, f"{expected}{cure and '; '}{cure}")
