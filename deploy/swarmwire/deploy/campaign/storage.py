"""A disk that is full, or refuses, and files that it damaged: told in one line, with what can be done."""

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput, SwarmwireError

if TYPE_CHECKING:
    import polars as pl

MEND = "without the file --resume runs again what it held"


class StorageFailed(SwarmwireError):
    """The folder of a campaign or of a tuning cannot be written any more."""


@contextmanager
def storing(folder: Path, command: str = "sweep") -> Generator[None]:
    """Turn what a disk refuses in the block into StorageFailed; `command` is what goes on with the folder."""
    import polars as pl

    try:
        yield
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        text = f"{folder}: cannot be written: {why}; what is done stays: swarmwire {command} --resume {folder}"
        raise StorageFailed(text) from error


def read_whole(file: Path, columns: list[str] | None = None, mend: str = MEND) -> "pl.DataFrame":
    """A Parquet file of a campaign; BadInput if it is damaged, as a power cut may leave it."""
    import polars as pl

    try:
        return pl.read_parquet(file, columns=columns)
    except (OSError, pl.exceptions.PolarsError) as error:
        why = str(error).partition("\n")[0]
        raise BadInput(str(file), "", f"expected a whole Parquet file: {why}; {mend}") from None
