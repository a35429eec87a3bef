"""Pictures of a robot, of a radio's coverage and of delivery over distance show what they are drawn from."""

import re
import struct
import sys
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.analysis.coverage import Band, ByDistance, CoverageMap
from swarmwire.comms.robot.bodies.body import body_from, body_names, load_body
from swarmwire.metrics.pictures.drawing import canvas, radio
from swarmwire.metrics.pictures.drawing.animation import write_mp4
from swarmwire.metrics.pictures.drawing.bodies import draw_body, draw_from_above, facts_of
from swarmwire.metrics.pictures.drawing.radio import draw_coverage, draw_distances
from swarmwire.metrics.records.run_folder.reader import RunFolder
from tests.support.metrics.radio import DISK, ticks
from tests.support.metrics.recorded import links, record
from tests.support.metrics.truths import departed, static, truth
from tests.support.refusals import refused_input

pytest.importorskip("matplotlib", reason="needs the extra [report]")


@pytest.mark.parametrize("name", body_names())
def test_body_drawing_exists_for_every_shipped_body(tmp_path, name):
    from PIL import Image

    names = [fact for fact, _ in facts_of(load_body(name)) if fact]
    assert len(names) == len(set(names))
    draw_body(load_body(name), tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert max(image.size) == 900
        assert len(np.unique(np.asarray(image).reshape(-1, 4), axis=0)) > 50


def test_rays_start_at_the_rim_and_end_at_their_range_with_the_front_up():
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    body, axes = load_body("epuck"), Figure().add_axes((0, 0, 1, 1))
    draw_from_above(axes, body)
    [rays] = [artist for artist in axes.collections if isinstance(artist, LineCollection)]
    ends = np.array([path.vertices for path in rays.get_paths()])  # (rays, 2, 2)
    assert body.proximity
    distance_m = np.linalg.norm(ends, axis=2)
    np.testing.assert_allclose(distance_m, [[body.radius_m, body.radius_m + body.proximity.range_m]] * len(ends))
    ahead_deg = np.degrees(np.arctan2(-ends[:, 1, 0], ends[:, 1, 1])) % 360  # counter-clockwise from up
    np.testing.assert_allclose(ahead_deg, body.proximity.angles_deg)


@pytest.mark.parametrize(("range_m", "faint"), [(0.12, 1.0), (2.0, 0.1)])
def test_rays_of_a_scan_fade_only_where_they_leave_the_view_and_the_legend_tells_their_range(range_m, faint):
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    readings = {"scan": {"rays": 1, "range_m": range_m}}
    axes = Figure().add_axes((0, 0, 1, 1))
    draw_from_above(axes, body_from({"like": "epuck", "name": "a", "sensors": readings}, "a.toml"))
    drawn = [artist for artist in axes.collections if isinstance(artist, LineCollection)][1:]
    assert min(part.get_alpha() for part in drawn) == pytest.approx(faint)
    legend = axes.get_legend()
    assert legend
    assert any(text.get_text().endswith(f" {range_m:g} m") for text in legend.get_texts())


def test_body_facts_are_those_of_the_data_sheet():
    facts = dict(facts_of(load_body("epuck")))
    numbers = {name: re.findall(r"[\d.]+ (?:%|\w+)", text) for name, text in facts.items()}
    assert numbers["size"] == ["7 cm", "8.6 cm"]
    assert numbers["wheels"] == ["5.3 cm"]
    assert numbers["proximity"] == ["8 rays", "10 cm"]
    assert numbers["odometry"] == ["5 %", "0.13 mm"]
    assert not {"positioning", "flies"} & facts.keys()
    assert "1 cm" in dict(facts_of(load_body("epuck-gps")))["positioning"]


def test_own_senses_and_actuators_are_facts_by_their_class():
    sheet = {"like": "epuck", "name": "sealer", "actuators": {"sealer": {"kind": "gas.py:Sealer"}}}
    sheet["sensors"] = {"gas": {"kind": "gas.py:Sniffer"}}
    facts = dict(facts_of(body_from({**sheet, "altitude_m": 1.0}, "sealer.toml")))
    assert "1 m" in facts["flies"]
    assert [facts[name].split()[-1] for name in ("gas", "sealer")] == ["gas.py:Sniffer", "gas.py:Sealer"]


def test_picture_size_that_is_too_large_is_refused():
    with refused_input("--size", match="8000"):
        canvas.new_figure(6.4, 4.8, 9000)


X_M, Y_M = np.linspace(-3.5, 3.5, 8), np.linspace(-2.5, 2.5, 6)
NEAR = np.hypot(X_M, Y_M[:, None]) < 2.0
SIGNALS = CoverageMap((0.0, 0.0), X_M, Y_M, np.where(NEAR, -60.0, -95.0), NEAR, NEAR * 1.0, np.ones_like(NEAR))
DISTANCES = np.array([0.5, 1.5, 2.5])
DELIVERY = Band(*np.array([[1.0, 0.8, 0.0], [1.0, 0.5, 0.0], [1.0, 1.0, 0.0]]))
STRENGTH = Band(*np.array([[-50.0, -70.0, -90.0]] * 3))


@pytest.mark.parametrize("signals", [True, False])
def test_coverage_of_signals_has_a_map_of_strength_and_that_of_a_disk_of_reach(tmp_path, monkeypatch, signals):
    drawn = []
    monkeypatch.setattr(radio, "save", lambda figure, to: (drawn.append(figure), canvas.save(figure, to)))
    result = SIGNALS if signals else replace(SIGNALS, mean_dbm=None)
    distances = ByDistance(DISTANCES, DELIVERY, STRENGTH if signals else None)
    draw_coverage(static(3), result, distances, -90.0 if signals else None, "a radio", tmp_path / "coverage.png")
    [figure] = drawn
    map_axes, *others = figure.axes
    assert figure.texts[0].get_text() == "a radio"
    assert (map_axes.get_xlim(), map_axes.get_ylim()) == ((-4.0, 4.0), (-3.0, 3.0))
    np.testing.assert_array_equal(map_axes.images[0].get_array().mask, ~NEAR)
    curves = [axes.lines[0].get_ydata().tolist() for axes in others if axes.lines]
    assert curves == [DELIVERY.mean.tolist(), STRENGTH.mean.tolist()][: 1 + signals]
    assert (tmp_path / "coverage.png").stat().st_size > 1000


def test_delivery_curve_of_the_table_ends_just_beyond_what_was_received(tmp_path, monkeypatch):
    run, drawn = static(6, arenas=2), []
    record(tmp_path, run, ticks(DISK, run, 3, count=20))
    monkeypatch.setattr(radio, "save", lambda figure, to: (drawn.append(figure), canvas.save(figure, to)))
    draw_distances(RunFolder(tmp_path), 1, tmp_path / "pdr.png", 640)
    [figure] = drawn
    upper, lower = figure.axes
    middle_m, ratio = upper.lines[0].get_data()
    table = RunFolder(tmp_path).radio_distances(1)
    np.testing.assert_allclose(ratio, table["pdr"].cast(float).to_numpy()[: len(ratio)])
    np.testing.assert_allclose(middle_m, (table["from_m"] + table["to_m"]).to_numpy()[: len(ratio)] / 2)
    last_m = table.filter(table["received"] > 0)["to_m"][-1]
    assert upper.get_xlim() == lower.get_xlim()
    assert upper.get_xlim()[1] == pytest.approx(1.5 * last_m, abs=0.1)
    assert "seed 2" in figure.texts[0].get_text()
    assert struct.unpack(">I", (tmp_path / "pdr.png").read_bytes()[16:20]) == (640,)


def test_distances_that_cannot_be_drawn_are_refused(tmp_path):
    run = static(2)
    record(tmp_path, run, [truth(run, departed=departed([]), finished=links([], [], 0, 0))])
    for arena, option in enumerate(("--kind", "--arena")):
        with pytest.raises(BadInput, check=lambda error, option=option: error.where == option):
            draw_distances(RunFolder(tmp_path), arena, tmp_path / "pdr.png", 640)
    (tmp_path / "radio_distances.parquet").unlink()
    with refused_input(key="radio_distances"):
        draw_distances(RunFolder(tmp_path), 0, tmp_path / "pdr.png", 640)


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (pl.col("pdr").cast(pl.String), "pdr .*String.*Float64"),
        (pl.lit(None, pl.Float64).alias("from_m"), "from_m .*null"),
        (pl.lit(7.0).alias("pdr"), "pdr .*received / intended"),
        (None, "no column pdr"),
    ],
)
def test_damaged_table_of_distances_is_refused_with_file_and_fault(tmp_path, change, fault):
    run = static(6)
    record(tmp_path, run, ticks(DISK, run, 3, count=20))
    file = tmp_path / "radio_distances.parquet"
    table = pl.read_parquet(file)
    (table.drop("pdr") if change is None else table.with_columns(change)).write_parquet(file)
    with pytest.raises(BadInput, match=rf"radio_distances\.parquet: .*{fault}"):
        draw_distances(RunFolder(tmp_path), 0, tmp_path / "pdr.png", 640)
    assert not (tmp_path / "pdr.png").exists()


@pytest.mark.parametrize("module", ["matplotlib", "jinja2", "imageio_ffmpeg"])
def test_missing_module_for_drawing_names_the_extra_that_brings_it(tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    if module == "imageio_ffmpeg":
        with refused_input(match=rf"{module}.*swarmwire\[film\]"):
            write_mp4(tmp_path / "a.mp4", iter(()), 10.0)
    else:
        with refused_input(match=rf"^pictures: .*{module}.*swarmwire-metrics\[report\]"):
            draw_body(load_body("epuck"), tmp_path / "a.png")
    assert not any(tmp_path.iterdir())
