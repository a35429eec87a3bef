"""`swarmwire radio fit`, in this process: what it prints, draws and writes, and what it refuses."""

import tomllib

import pytest

from swarmwire.comms.air.propagation.parameters import Shadowing
from swarmwire.comms.air.reception.parameters import Bursts
from tests.deploy.commands import called
from tests.metrics.radio_fit.synthetic import csv_of, made

SMALL = "t_s,tx,rx,seq,rssi_dbm,distance_m\n" + "".join(f"{i},a,b,{i},{-50 - i},{1 + i}\n" for i in range(20))


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_log_becomes_a_table_a_picture_and_what_stands_in_a_scenario(here, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    (here / "log.csv").write_text(csv_of(made(1, Shadowing(4.0, 5.0), Bursts(0.5, 5.0), packets=60)))
    to = ["--to", "fit.png", "--write", "radio.toml", "--power-dbm", "4", "--size", "400"]
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", *to)
    assert (code, errors) == (0, "")
    for said in ("path loss exponent", "standard error", "correlation distance", "bursts: mean", "root mean square"):
        assert said in out
    assert out.endswith("written: fit.png\nwritten: radio.toml\n")
    assert (here / "fit.png").read_bytes().startswith(b"\x89PNG")
    radio = tomllib.loads((here / "radio.toml").read_text())["radio"]
    assert sorted(radio) == ["antenna", "bursts", "log_distance", "model", "shadowing"]
    assert 42.0 < radio["log_distance"]["reference_loss_db"] < 46.0


def test_without_a_file_the_table_is_printed_and_what_is_left_out_is_named(here, monkeypatch, capsys):
    (here / "log.csv").write_text(SMALL)
    code, out, _ = called(monkeypatch, capsys, "radio", "fit", "log.csv")
    assert code == 0
    assert "left out: shadowing: needs positions" in out
    assert "left out: losses: needs 100 packets, got 20" in out
    assert "log_distance" in tomllib.loads(out[out.index("# Fitted to") :])["radio"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["absent.csv"], "absent.csv: expected a readable file: No such file or directory"),
        (["log.csv", "--write", "radio.json"], "radio.json: expected a file name that ends in .toml"),
        (["log.csv", "--write", "absent/radio.toml"], "absent/radio.toml: expected a path in a folder that exists"),
        (["log.csv", "--to", "fit.bmp"], "fit.bmp: expected a file name that ends in .png or .svg or .pdf"),
        (["log.csv", "--within", "0.5"], "--within: expected a distance within which there are packets, got 0.5 m"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(here, monkeypatch, capsys, arguments, told):
    (here / "log.csv").write_text(SMALL)
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", *arguments)
    assert (code, out, errors) == (2, "", f"error: {told}\n")
