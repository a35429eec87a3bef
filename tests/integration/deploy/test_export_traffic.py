"""`swarmwire export --to traffic.pcapng`: what was on air, as an independent reader and tshark find it."""

import re
import shutil
import subprocess
from pathlib import Path

import polars as pl
import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.deploy import RunFolder, run
from swarmwire.deploy.cli.app import app
from swarmwire.deploy.config import Recording
from swarmwire.metrics.run_folder.table import State
from swarmwire.metrics.run_folder.verify import verify
from tests.support.deploy.commands import ROOT
from tests.support.metrics.capture.reading import Capture, read

SCENARIO = ROOT / "scenarios" / "flocking-802154.toml"
SHORT = ["duration_s=0.5", "robots.flock.count=6"]
MEASURES = "measures={range={},bearing={}}"
HEADERS = {"ieee802154": (283, 36 + 9), "wifi-b-1M": (127, 15 + 24 + 8 + 28), "argos-rab": (147, 20)}


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> dict[str, Path]:
    """A run for each kind of link."""
    made: dict[str, Path] = {}
    for preset in HEADERS:
        made[preset] = tmp_path_factory.mktemp("runs") / preset
        overrides = [*SHORT, f'radio={{preset="{preset}",{MEASURES}}}']
        run(SCENARIO, overrides=overrides, out=made[preset], record=Recording(packets=1.0))
    return made


def exported(folder: Path, to: Path, *options: str) -> Capture:
    ended = CliRunner().invoke(app, ["export", str(folder), "--to", str(to), *options], catch_exceptions=False)
    assert ended.exit_code == 0, ended.output
    found = read(to)
    assert f"({len(found.packets)} frames)" in ended.output
    return found


@pytest.mark.parametrize("preset", HEADERS)
def test_a_capture_holds_each_packet_on_air_once_with_headers_and_payload(folders, tmp_path, preset):
    found, packets = exported(folders[preset], tmp_path / "t.pcapng"), RunFolder(folders[preset]).packets()
    link_type, header_bytes = HEADERS[preset]
    on_air = packets.drop_nulls("receiver").unique(["sender", "sequence"]).sort("on_air_at_ns", "sender", "sequence")
    assert found.link_type == link_type
    assert len(found.packets) > 20
    assert [one.at_ns for one in found.packets] == on_air["on_air_at_ns"].to_list()
    assert [one.data[header_bytes:] for one in found.packets] == on_air["payload"].to_list()
    assert all(one.length == len(one.data) == header_bytes + 6 for one in found.packets)
    comments = [comment for one in found.packets for comment in one.comments]
    assert sum(comment.startswith("received: ") for comment in comments) > 20
    assert comments[0].endswith("to all: Heading, packet 0")


def test_a_capture_can_be_of_a_part_of_the_run(folders, tmp_path):
    whole = exported(folders["ieee802154"], tmp_path / "whole.pcapng")
    part = exported(folders["ieee802154"], tmp_path / "part.pcapng", "--from", "0.1", "--until", "0.3")
    kept = [one for one in whole.packets if 100_000_000 <= one.at_ns < 300_000_000]
    assert part.packets == kept
    assert 0 < len(kept) < len(whole.packets)


FIELDS = {
    "ieee802154": ["wpan.src16", "wpan.dst16", "wpan.seq_no"],
    "wifi-b-1M": ["ip.src", "ip.dst", "udp.length"],
    "argos-rab": ["frame.len"],
}
FIRST = {
    "ieee802154": ["0xffff", "0"],
    "wifi-b-1M": ["255.255.255.255", "14"],
    "argos-rab": ["26"],
}


@pytest.mark.skipif(shutil.which("tshark") is None, reason="needs tshark")
@pytest.mark.parametrize("preset", HEADERS)
def test_tshark_reads_every_frame_and_finds_no_fault(folders, tmp_path, preset):
    to = tmp_path / "t.pcapng"
    found = exported(folders[preset], to)
    fields = ["_ws.malformed", "frame.time_epoch", *FIELDS[preset]]
    command = ["tshark", "-r", str(to), "-T", "fields", *(part for name in fields for part in ("-e", name))]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    rows = [line.split("\t") for line in ended.stdout.splitlines()]
    assert len(rows) == len(found.packets)
    assert {row[0] for row in rows} == {""}
    assert [row[1] for row in rows] == [f"0.{one.at_ns:09d}" for one in found.packets]
    assert rows[0][-len(FIRST[preset]) :] == FIRST[preset]


FAULTS = [
    (["--at", "1"], "--at"),
    (["--kind", "delivery"], "--kind"),
    (["--fps", "5"], "--fps"),
    (["--from", "5", "--until", "4"], "--until"),
    (["--from", "0.1", "--until", "0.1"], "--until"),
    (["--from", "nan"], "--from"),
    (["--until", "inf"], "--until"),
    (["--size", "300"], "--size"),
    (["--arena", "3"], "--arena"),
]


@pytest.mark.parametrize(("options", "option"), FAULTS)
def test_what_does_not_fit_a_capture_is_refused(folders, tmp_path, options, option):
    with pytest.raises(BadInput, match=f"^{option}: expected "):
        exported(folders["argos-rab"], tmp_path / "t.pcapng", *options)
    assert not list(tmp_path.iterdir())


def test_the_older_kind_of_capture_is_refused_with_the_name_of_the_newer(folders, tmp_path):
    with pytest.raises(BadInput, match=r"t\.pcap: .*\.pcapng"):
        exported(folders["argos-rab"], tmp_path / "t.pcap")


DAMAGED = [
    (pl.lit(99).cast(pl.Int32).alias("sender"), "sender is beyond 5"),
    (pl.lit(-1).cast(pl.Int32).alias("to"), "to is below 0"),
    (pl.lit(None).cast(pl.Int64).alias("on_air_at_ns"), "on_air_at_ns is null"),
    (pl.col("on_air_at_ns").cast(pl.String), "on_air_at_ns .*String.* Int64"),
    (pl.lit("eaten").alias("fate"), "fate .*String.* Enum"),
]


@pytest.mark.parametrize(("change", "text"), DAMAGED)
def test_damaged_packets_are_refused_with_file_and_fault_and_verify_finds_them(folders, tmp_path, change, text):
    folder = tmp_path / "run"
    shutil.copytree(folders["argos-rab"], folder)
    file = folder / "packets.parquet"
    pl.read_parquet(file).with_columns(change).write_parquet(file)
    with pytest.raises(BadInput, match=rf"packets\.parquet: .*{text}"):
        exported(folder, tmp_path / "t.pcapng")
    assert not (tmp_path / "t.pcapng").exists()
    (found,) = (finding for finding in verify(folder) if finding.part == "packets")
    assert found.state is State.DAMAGED
    assert re.match(text, found.text)


def test_packets_whose_arenas_are_no_numbers_are_refused_in_one_line_with_the_file(folders, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(folders["argos-rab"], folder)
    file = folder / "packets.parquet"
    pl.read_parquet(file).with_columns(pl.col("arena").cast(pl.String)).write_parquet(file)
    with pytest.raises(BadInput, match=r"^\S+packets\.parquet: expected [^\n]+$"):
        exported(folder, tmp_path / "t.pcapng")


def test_a_run_whose_packets_were_not_recorded_is_refused_with_the_way_out(tmp_path):
    run(SCENARIO, overrides=SHORT, out=tmp_path / "run")
    with pytest.raises(BadInput, match="--packets all"):
        exported(tmp_path / "run", tmp_path / "t.pcapng")
