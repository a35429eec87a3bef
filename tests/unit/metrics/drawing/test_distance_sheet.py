"""The picture of the delivery ratio over distance shows what the table holds."""

import struct

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.drawing import canvas, distance_sheet
from swarmwire.metrics.drawing.distance_sheet import draw_distances
from swarmwire.metrics.run_folder import RunFolder
from tests.support.metrics.radio_runs import DISK, ticks
from tests.support.metrics.recorded import links, record
from tests.support.metrics.truths import departed, static, truth

pytest.importorskip("matplotlib", reason="needs the extra [report]")


def test_the_curve_is_that_of_the_table_up_to_somewhat_beyond_what_was_heard(tmp_path, monkeypatch):
    of, drawn = static(6, arenas=2), []
    record(tmp_path, of, ticks(DISK, of, 3, count=20))
    monkeypatch.setattr(distance_sheet, "save", lambda figure, to: (drawn.append(figure), canvas.save(figure, to)))
    draw_distances(RunFolder(tmp_path), 1, tmp_path / "pdr.png", 640)
    [figure] = drawn
    upper, lower = figure.axes
    middle_m, ratio = upper.lines[0].get_data()
    table = RunFolder(tmp_path).radio_distances(1)
    np.testing.assert_allclose(ratio, table["pdr"].cast(float).to_numpy()[: len(ratio)])
    np.testing.assert_allclose(middle_m, (table["from_m"] + table["to_m"]).to_numpy()[: len(ratio)] / 2)
    last_m = table.filter(table["heard"] > 0)["to_m"][-1]
    assert upper.get_xlim() == lower.get_xlim()
    assert upper.get_xlim()[1] == pytest.approx(1.5 * last_m, abs=0.1)
    assert "seed 2" in figure.texts[0].get_text()
    assert struct.unpack(">I", (tmp_path / "pdr.png").read_bytes()[16:20]) == (640,)


def test_what_cannot_be_drawn_is_refused(tmp_path):
    of = static(2)
    record(tmp_path, of, [truth(of, departed=departed([]), finished=links([], [], 0, 0))])
    with pytest.raises(BadInput, match="--pdr: expected a run in which packets went on air"):
        draw_distances(RunFolder(tmp_path), 0, tmp_path / "pdr.png", 640)
    with pytest.raises(BadInput, match="--arena: expected 0 to 0, got 1"):
        draw_distances(RunFolder(tmp_path), 1, tmp_path / "pdr.png", 640)
    (tmp_path / "radio_distances.parquet").unlink()
    with pytest.raises(BadInput, match="radio_distances: expected this table"):
        draw_distances(RunFolder(tmp_path), 0, tmp_path / "pdr.png", 640)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (pl.col("pdr").cast(pl.String), "pdr is of type String, expected Float64"),
        (pl.lit(None, pl.Float64).alias("from_m"), r"from_m is null in \d+ rows"),
        (pl.lit(7.0).alias("pdr"), r"pdr is not heard / intended in \d+ rows"),
        (None, "no column pdr"),
    ],
)
def test_a_damaged_table_is_refused_with_file_and_fault(tmp_path, change, text):
    of = static(6)
    record(tmp_path, of, ticks(DISK, of, 3, count=20))
    file = tmp_path / "radio_distances.parquet"
    table = pl.read_parquet(file)
    (table.drop("pdr") if change is None else table.with_columns(change)).write_parquet(file)
    with pytest.raises(BadInput, match=rf"radio_distances\.parquet: expected a table as a run writes it, but {text}"):
        draw_distances(RunFolder(tmp_path), 0, tmp_path / "pdr.png", 640)
    assert not (tmp_path / "pdr.png").exists()
