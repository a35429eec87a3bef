"""`swarmwire export`, in this process, of run folders made by hand."""

import sys
from types import ModuleType

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.app import app
from swarmwire.metrics.drawing.film import film_of
from tests.support.metrics.films import Folder, film, ticks_frame

pytest.importorskip("matplotlib", reason="needs the extra [report]")
SMALL = ("--size", "200")


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A run folder of three seconds at 10 Hz."""
    reader = ModuleType("swarmwire.metrics.run_folder.reader")
    reader.RunFolder = Folder
    monkeypatch.setitem(sys.modules, reader.__name__, reader)
    folder = tmp_path / "run"
    folder.mkdir()
    ticks_frame(film(ticks=30)).write_parquet(folder / "ticks.parquet")
    return folder


def export(*arguments) -> str:
    ended = CliRunner().invoke(app, ["export", *map(str, arguments)], catch_exceptions=False)
    assert ended.exit_code == 0, ended.output
    return ended.output


def pixels(path):
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_a_picture_is_of_the_end_unless_a_time_is_named(run, tmp_path):
    assert export(run, *SMALL).startswith(f"written: {run}/picture.png (")
    end = pixels(run / "picture.png")
    assert max(end.shape) == 200
    for name, time, same in (("end", [], True), ("last", ["--at", "2.9"], True), ("first", ["--at", "0"], False)):
        export(run, *SMALL, "--to", tmp_path / f"{name}.png", *time)
        assert np.array_equal(pixels(tmp_path / f"{name}.png"), end) == same


def test_a_table_holds_the_metrics_over_time(run, tmp_path):
    of, to = film(ticks=30), tmp_path / "metrics.csv"
    assert export(run, "--to", to) == f"written: {to} (30 rows)\n"
    table = pl.read_csv(to)
    assert table.columns == ["time_s", *film_of(Folder(run), 0, "run").metrics]
    assert table["time_s"].to_list() == of.time_s.tolist()
    np.testing.assert_array_equal(table["order"].cast(float).to_numpy(), of.metrics["order"])
    export(run, "--to", to, "--metric", "order", "--from", "1", "--until", "2")
    part = pl.read_csv(to)
    assert part.columns == ["time_s", "order"]
    assert part["time_s"].to_list() == [at_s for at_s in of.time_s.tolist() if 1.0 <= at_s <= 2.0]


def test_a_gif_lasts_as_long_as_the_run_and_says_what_it_is(run):
    from PIL import Image

    told = export(run, "--to", run / "film.gif", *SMALL)
    assert told.splitlines()[0] == "30 frames, 10 a second, 1 x real time"
    assert told.splitlines()[1].startswith(f"written: {run}/film.gif (")
    with Image.open(run / "film.gif") as gif:
        assert gif.n_frames == 30
        assert gif.info["duration"] == 100


def test_an_mp4_is_of_the_time_and_speed_asked_for(run, tmp_path):
    import imageio_ffmpeg

    to = tmp_path / "a.mp4"
    told = export(run, "--to", to, "--from", "1", "--until", "2", "--fps", "5", "--speed", "0.5", *SMALL)
    assert told.splitlines()[0] == "11 frames, 5 a second, 0.5 x real time"
    assert imageio_ffmpeg.count_frames_and_secs(str(to)) == (11, pytest.approx(2.2))


def test_a_run_that_was_killed_is_exported_up_to_its_last_part(run):
    from PIL import Image

    whole = run / "ticks.parquet"
    whole.unlink()
    (run / "ticks").mkdir()
    ticks_frame(film(ticks=12)).write_parquet(run / "ticks" / "part-0.parquet")
    export(run, "--to", run / "film.gif", *SMALL)
    with Image.open(run / "film.gif") as gif:
        assert gif.n_frames == 12


@pytest.mark.parametrize(
    ("arguments", "place", "expected"),
    [
        (["--at", "7"], "--at", "0 to 2.9 s"),
        (["--at", "nan"], "--at", "0 to 2.9 s"),
        (["--fps", "5"], "--fps", ".gif, .mp4"),
        (["--to", "a.gif", "--at", "1"], "--at", ".png"),
        (["--to", "a.gif", "--kind", "arena"], "--kind", "film"),
        (["--kind", "arenas"], "--kind", "arena, delivery, viewer (did you mean arena?)"),
        (["--to", "a.gif", "--until", "9"], "--until", "0 to 2.9 s"),
        (["--arena", "1"], "RUN: arena", "0 to 0"),
        (["--metric", "ordr"], "--metric: ordr", "order, min_gap"),
        (["--to", "a.csv", "--metric", "ordr"], "--metric: ordr", "order"),
        (["--to", "a.csv", "--from", "9"], "--from", "0 to 2.9 s"),
        (["--to", "a.avi"], "a.avi", ".gif, .mp4"),
        (["--to", "a.gif", "--size", "5"], "--size", "100 to 8000 pixels"),
    ],
)
def test_what_cannot_be_exported_is_refused_and_leaves_nothing(run, monkeypatch, arguments, place, expected):
    monkeypatch.chdir(run)
    with pytest.raises(BadInput) as error:
        export(run, *arguments)
    assert ": ".join(filter(None, (error.value.where, error.value.key))) == place.replace("RUN", str(run))
    assert expected in error.value.expected
    assert [path.name for path in run.iterdir()] == ["ticks.parquet"]


def test_a_film_that_fails_half_way_leaves_the_one_before(run, monkeypatch):
    from swarmwire.metrics.drawing.animation import FilmFigure

    export(run, "--to", run / "film.mp4", *SMALL)
    before = (run / "film.mp4").read_bytes()
    frame = FilmFigure.frame

    def failing(self, index):
        if index == 20:
            raise RuntimeError("half way")
        return frame(self, index)

    monkeypatch.setattr(FilmFigure, "frame", failing)
    with pytest.raises(RuntimeError, match="half way"):
        export(run, "--to", run / "film.mp4", *SMALL)
    assert (run / "film.mp4").read_bytes() == before
    assert {path.name for path in run.iterdir()} == {"ticks.parquet", "film.mp4"}
