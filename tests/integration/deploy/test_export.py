"""Exports."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from swarmwire.deploy import RunFolder
from swarmwire.deploy import run as run_scenario
from swarmwire.deploy.cli.actions import export_metrics_table, export_pictures
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.runs.config import Recording
from swarmwire.metrics.pictures.drawing.film import film_of
from swarmwire.metrics.records.run_folder.table import TableState
from swarmwire.metrics.records.run_folder.verify import verify
from swarmwire.world.motion.traces.reading import read_trace
from swarmwire.world.motion.traces.trace import TracePoses
from tests.integration.deploy.test_draw import pixels
from tests.support.deploy.runs import ROOT
from tests.support.metrics.films import Capture, Folder, film, read, ticks_frame
from tests.support.refusals import refused_input

pytest.importorskip("matplotlib", reason="needs the extra [report]")
SMALL = ("--size", "200")
SCENARIO = ROOT / "scenarios" / "flocking-802154.toml"
SHORT = ["duration_s=0.5", "robots.flock.count=6"]
MEASURES = "measures={range={},bearing={}}"
HEADERS = {"ieee802154": (283, 36 + 9), "wifi-b-1M": (127, 15 + 24 + 8 + 28), "argos-rab": (147, 20)}
FIELDS = {
    "ieee802154": ["wpan.src16", "wpan.dst16", "wpan.seq_no"],
    "wifi-b-1M": ["ip.src", "ip.dst", "udp.length"],
    "argos-rab": ["frame.len"],
}
FIRST = {"ieee802154": ["0xffff", "0"], "wifi-b-1M": ["255.255.255.255", "14"], "argos-rab": ["26"]}
FAULTS = [  # a file, options, and the option at fault
    *(("t.pcapng", option) for option in ("--at 1", "--kind delivery", "--fps 5", "--from nan", "--until inf")),
    *(("t.pcapng", option) for option in ("--until 4 --from 5", "--until 0.1 --from 0.1", "--size 300", "--arena 3")),
    *(("a.eel", option) for option in ("--origin 1,2", "--origin 91,2,3", "--arena 3")),
    *(("a.tcl", option) for option in ("--origin 1,2,3", "--from 9", "--metric order")),
]
DAMAGED = [
    (pl.lit(99).cast(pl.Int32).alias("sender"), "sender is beyond 5"),
    (pl.lit(-1).cast(pl.Int32).alias("to"), "to is below 0"),
    (pl.lit(None).cast(pl.Int64).alias("on_air_at_ns"), "on_air_at_ns is null"),
    (pl.col("on_air_at_ns").cast(pl.String), "on_air_at_ns .*String.* Int64"),
    (pl.lit("eaten").alias("fate"), "fate .*String.* Enum"),
    (pl.col("arena").cast(pl.String), "arena .*String"),
]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A run folder of three seconds at 10 Hz."""
    for module in (export_metrics_table, export_pictures):
        monkeypatch.setattr(module, "RunFolder", Folder)
    folder = tmp_path / "run"
    folder.mkdir()
    ticks_frame(film(ticks=30)).write_parquet(folder / "ticks.parquet")
    return folder


def export(*arguments) -> str:
    ended = CliRunner().invoke(app, ["export", *map(str, arguments)], catch_exceptions=False)
    assert ended.exit_code == 0, ended.output
    return ended.output


def test_picture_is_of_the_end_unless_a_time_is_given(run, tmp_path):
    assert export(run, *SMALL).startswith(f"written: {run}/picture.png (")
    end = pixels(run / "picture.png")
    assert max(end.shape) == 200
    for name, time, same in (("end", [], True), ("last", ["--at", "2.9"], True), ("first", ["--at", "0"], False)):
        export(run, *SMALL, "--to", tmp_path / f"{name}.png", *time)
        assert np.array_equal(pixels(tmp_path / f"{name}.png"), end) == same


def test_table_export_holds_the_metrics_over_time(run, tmp_path):
    recorded, to = film(ticks=30), tmp_path / "metrics.csv"
    assert export(run, "--to", to) == f"written: {to} (30 rows)\n"
    table = pl.read_csv(to)
    assert table.columns == ["time_s", *film_of(Folder(run), 0, "run").metrics]
    assert table["time_s"].to_list() == recorded.time_s.tolist()
    np.testing.assert_array_equal(table["order"].cast(float).to_numpy(), recorded.metrics["order"])
    export(run, "--to", to, "--metric", "order", "--from", "1", "--until", "2")
    part = pl.read_csv(to)
    assert part.columns == ["time_s", "order"]
    assert part["time_s"].to_list() == [at_s for at_s in recorded.time_s.tolist() if 1.0 <= at_s <= 2.0]


def test_gif_lasts_as_long_as_the_run_and_prints_its_frames(run):
    from PIL import Image

    output = export(run, "--to", run / "film.gif", *SMALL)
    assert output.splitlines()[0] == "30 frames, 10 a second, 1 x real time"
    assert output.splitlines()[1].startswith(f"written: {run}/film.gif (")
    with Image.open(run / "film.gif") as gif:
        assert gif.n_frames == 30
        assert gif.info["duration"] == 100


def test_mp4_is_of_the_given_time_and_speed(run, tmp_path):
    import imageio_ffmpeg

    to = tmp_path / "a.mp4"
    output = export(run, "--to", to, "--from", "1", "--until", "2", "--fps", "5", "--speed", "0.5", *SMALL)
    assert output.splitlines()[0] == "11 frames, 5 a second, 0.5 x real time"
    assert imageio_ffmpeg.count_frames_and_secs(str(to)) == (11, pytest.approx(2.2))


def test_mp4_without_the_encoder_is_refused_before_a_frame_is_drawn(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(export_pictures, "RunFolder", None)  # to call it would be another error
    with refused_input(match=r"swarmwire\[film\]"):
        export(run, "--to", run / "film.mp4", *SMALL)


def test_export_of_a_killed_run_reaches_to_its_last_part(run):
    from PIL import Image

    path = run / "ticks.parquet"
    path.unlink()
    (run / "ticks").mkdir()
    ticks_frame(film(ticks=12)).write_parquet(run / "ticks" / "part-0.parquet")
    export(run, "--to", run / "film.gif", *SMALL)
    with Image.open(run / "film.gif") as gif:
        assert gif.n_frames == 12


@pytest.mark.parametrize(
    ("arguments", "where", "expected"),
    [
        (["--at", "7"], "--at", "0 to 2.9 s"),
        (["--at", "nan"], "--at", "0 to 2.9 s"),
        (["--fps", "5"], "--fps", ".gif, .mp4"),
        (["--to", "a.gif", "--at", "1"], "--at", ".png"),
        (["--to", "a.gif", "--kind", "arena"], "--kind", "film"),
        (["--kind", "arenas"], "--kind", "arena (did you mean this?), delivery, viewer"),
        (["--to", "a.gif", "--until", "9"], "--until", "0 to 2.9 s"),
        (["--arena", "1"], "RUN: arena", "0 to 0"),
        (["--metric", "ordr"], "--metric: ordr", "order (did you mean this?), min_gap"),
        (["--to", "a.csv", "--metric", "ordr"], "--metric: ordr", "order"),
        (["--to", "a.csv", "--from", "9"], "--from", "0 to 2.9 s"),
        (["--to", "a.avi"], "a.avi", ".gif, .mp4"),
        (["--to", "a.gif", "--size", "5"], "--size", "100 to 8000 pixels"),
    ],
)
def test_export_options_that_are_invalid_are_refused(run, monkeypatch, arguments, where, expected):
    monkeypatch.chdir(run)
    with refused_input(match=f"^{where.replace('RUN', str(run))}: .*{re.escape(expected)}"):
        export(run, *arguments)
    assert [path.name for path in run.iterdir()] == ["ticks.parquet"]


def test_film_that_fails_half_way_leaves_the_one_before(run, monkeypatch):
    from swarmwire.metrics.pictures.drawing.animation import FilmFigure

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


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> dict[str, Path]:
    """A run for each kind of link."""
    made: dict[str, Path] = {}
    for preset in HEADERS:
        made[preset] = tmp_path_factory.mktemp("runs") / preset
        overrides = [*SHORT, f'radio={{preset="{preset}",{MEASURES}}}']
        run_scenario(SCENARIO, overrides=overrides, out=made[preset], record=Recording(packets=1.0))
    return made


MOTION_FILES = ["a.csv", "a.parquet", "a.movements", "a.tcl", "a.eel"]


@pytest.mark.parametrize("name", MOTION_FILES)
def test_motion_export_follows_the_robots(folders, tmp_path, name):
    origin, folder = (47.4, 8.5, 400.0), folders["ieee802154"]
    options = ["--origin", "47.4,8.5,400"] if name == "a.eel" else []
    assert "(6 robots, " in export(folder, "--to", tmp_path / name, "--kind", "motion", *options)
    trace, recorded, static = read_trace(tmp_path / name, origin=origin), RunFolder(folder), RunFolder(folder).static
    if name in ("a.movements", "a.tcl"):  # their origin is the lower left corner
        assert min(trace.x_m.min(), trace.y_m.min()) > 0.0
        trace = trace.shifted(-0.5 * static.arena_size_m[0], -0.5 * static.arena_size_m[1])
    if name in ("a.csv", "a.parquet"):
        assert trace.names == static.robot_names
    followed = TracePoses(trace, range(static.robots), 0.0)
    for time_s, part in ((time_s, part) for (time_s,), part in recorded.robots().group_by("time_s")):
        columns = ("x_m", "y_m", "heading_rad") if name in ("a.csv", "a.parquet") else ("x_m", "y_m")
        at = followed.at(time_s)[:, [0, 1, 3]][:, : len(columns)]
        np.testing.assert_allclose(at, part.select(columns).to_numpy(), rtol=0.0, atol=2e-6)


def test_motion_export_can_be_of_a_part_of_the_run(folders, tmp_path):
    export(folders["ieee802154"], "--to", tmp_path / "a.parquet", "--from", "0.1", "--until", "0.3")
    t_s = read_trace(tmp_path / "a.parquet").t_s
    assert (t_s.min(), t_s.max()) == (0.1, 0.3)


def test_motion_export_has_the_heights_of_a_run_that_recorded_them(folders, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(folders["argos-rab"], folder)
    file = folder / "ticks.parquet"
    ticks = pl.read_parquet(file)
    height_m = pl.Series("z_m", [[0.25 * robot for robot in range(6)]] * len(ticks), pl.Array(pl.Float32, 6))
    ticks.with_columns(height_m).write_parquet(file)
    export(folder, "--to", tmp_path / "a.movements")
    trace = read_trace(tmp_path / "a.movements")
    assert trace.z_m.tolist() == np.repeat(0.25 * np.arange(6), len(ticks)).tolist()


def exported(folder: Path, to: Path, *options: str) -> Capture:
    output = export(folder, "--to", to, *options)
    capture, radio = read(to), json.loads((folder / "summary.json").read_text())["radio"]
    count = radio["fates"].get("in_flight", 0)
    more = f"; {count} receptions were in flight at the end" if count else ""
    assert f"({len(capture.packets)} frames{more})" in " ".join(output.split())
    return capture


@pytest.mark.parametrize("preset", HEADERS)
def test_capture_holds_each_packet_on_air_once_with_headers_and_payload(folders, tmp_path, preset):
    capture, packets = exported(folders[preset], tmp_path / "t.pcapng"), RunFolder(folders[preset]).packets()
    link_type, header_bytes = HEADERS[preset]
    on_air = packets.drop_nulls("receiver").unique(["sender", "sequence"]).sort("on_air_at_ns", "sender", "sequence")
    assert capture.link_type == link_type
    assert len(capture.packets) > 20
    assert [one.at_ns for one in capture.packets] == on_air["on_air_at_ns"].to_list()
    assert [one.data[header_bytes:] for one in capture.packets] == on_air["payload"].to_list()
    assert all(one.length == len(one.data) == header_bytes + 6 for one in capture.packets)
    comments = [comment for one in capture.packets for comment in one.comments]
    assert sum(comment.startswith("received: ") for comment in comments) > 20
    assert comments[0].endswith("to all: Heading, packet 0")


def test_capture_can_be_of_a_part_of_the_run(folders, tmp_path):
    capture = exported(folders["ieee802154"], tmp_path / "whole.pcapng")
    part = exported(folders["ieee802154"], tmp_path / "part.pcapng", "--from", "0.1", "--until", "0.3")
    packets = [one for one in capture.packets if 100_000_000 <= one.at_ns < 300_000_000]
    assert part.packets == packets
    assert 0 < len(packets) < len(capture.packets)


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
@pytest.mark.parametrize("preset", HEADERS)
def test_tshark_reads_every_frame_and_finds_no_fault(folders, tmp_path, preset):
    to = tmp_path / "t.pcapng"
    capture = exported(folders[preset], to)
    fields = ["_ws.malformed", "frame.time_epoch", *FIELDS[preset]]
    command = ["tshark", "-r", str(to), "-T", "fields", *(part for name in fields for part in ("-e", name))]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    rows = [line.split("\t") for line in ended.stdout.splitlines()]
    assert len(rows) == len(capture.packets)
    assert {row[0] for row in rows} == {""}
    assert [row[1] for row in rows] == [f"0.{one.at_ns:09d}" for one in capture.packets]
    assert rows[0][-len(FIRST[preset]) :] == FIRST[preset]


@pytest.mark.parametrize(("name", "options"), FAULTS)
def test_capture_and_motion_options_that_do_not_fit_are_refused(folders, tmp_path, name, options):
    with refused_input(options.split()[0]):
        export(folders["argos-rab"], "--to", tmp_path / name, *options.split())
    assert not list(tmp_path.iterdir())


def test_capture_of_the_older_pcap_kind_is_refused_in_favour_of_pcapng(folders, tmp_path):
    with refused_input(match=r"t\.pcap: .*\.pcapng"):
        export(folders["argos-rab"], "--to", tmp_path / "t.pcap")


@pytest.mark.parametrize(("change", "text"), DAMAGED)
def test_damaged_packets_are_refused_with_file_and_fault_and_verify_finds_them(folders, tmp_path, change, text):
    folder = tmp_path / "run"
    shutil.copytree(folders["argos-rab"], folder)
    file = folder / "packets.parquet"
    pl.read_parquet(file).with_columns(change).write_parquet(file)
    with refused_input(match=rf"packets\.parquet: .*{text}"):
        export(folder, "--to", tmp_path / "t.pcapng")
    assert not (tmp_path / "t.pcapng").exists()
    (packets_finding,) = (finding for finding in verify(folder) if finding.part == "packets")
    assert packets_finding.state is TableState.DAMAGED
    assert re.search(text, packets_finding.text)


def test_capture_of_a_run_without_packets_is_refused_with_the_remedy(tmp_path):
    run_scenario(SCENARIO, overrides=SHORT, out=tmp_path / "run")
    with refused_input(match="--packets all"):
        export(tmp_path / "run", "--to", tmp_path / "t.pcapng")
