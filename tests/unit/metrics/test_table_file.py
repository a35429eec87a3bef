"""A Parquet file that is damaged is one line that names it, whatever polars makes of it."""

from io import BytesIO
from pathlib import Path

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.run_folder.writer import PARQUET
from swarmwire.metrics.table_file import read_parquet, refuse_corrupt
from tests.support.damaged import damaged

FRAME = pl.DataFrame({"run": [0, 0, 1, 1], "order": [0.5, None, 0.25, 1.0], "ended": ["stopped", "failed", "", "é"]})


def parquet(frame: pl.DataFrame) -> bytes:
    file = BytesIO()
    frame.write_parquet(file, **PARQUET)
    return file.getvalue()


def refusal(file: Path) -> str | None:
    """What is said of the file; None: it can be read."""
    try:
        read_parquet(file, cure="take it away")
    except BadInput as told:
        return str(told)
    return None


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patched:
        patched.setenv("RUST_BACKTRACE", "0")  # to name the functions of a panic takes seconds
        yield tmp_path_factory.mktemp("damaged") / "part.parquet"


@settings(max_examples=60)
@given(data=damaged(parquet(FRAME)))
def test_a_file_that_is_cut_off_or_changed_is_read_or_refused_in_one_line_that_names_it(file, data):
    file.write_bytes(data)
    said = refusal(file)
    if said is not None:
        assert said.startswith(f"{file}: ")
        assert said.endswith("take it away")
        assert "\n" not in said


def test_a_panic_of_polars_is_such_a_line_too(file, monkeypatch):
    def panics(*_, **__):
        raise pl.exceptions.PanicException("called `Result::unwrap()` on an `Err` value")

    monkeypatch.setattr(pl, "read_parquet", panics)
    with pytest.raises(BadInput, check=lambda error: error.where == str(file)):
        read_parquet(file)


def test_a_file_that_is_not_there_is_such_a_line_too(tmp_path):
    with pytest.raises(BadInput, match="none.parquet: .*No such file"):
        read_parquet(tmp_path / "none.parquet")


@given(place=st.integers(0, 2), how=st.sampled_from([parquet(FRAME)[:-1], parquet(FRAME.cast({"order": pl.String}))]))
def test_of_several_files_the_damaged_one_is_named_or_that_of_other_types(file, place, how):
    files = [file.with_name(f"{number}.parquet") for number in range(3)]
    for each in files:
        each.write_bytes(parquet(FRAME))
    refuse_corrupt(files)
    files[place].write_bytes(how)
    with pytest.raises(BadInput) as told:
        refuse_corrupt(files)
    # Where the first is of other types than the rest, it is the second that differs from what came before.
    assert told.value.where == str(files[place] if place or how.endswith(b"PAR") else files[1])
