"""`swarmwire radio`: probes of a radio, and radios fitted to logs."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Shadowing
from swarmwire.deploy.cli.app import app
from swarmwire.world.scenario_file import scenario_from
from tests.support.deploy.runs import LOSSY, ROOT, called, refused_command
from tests.support.metrics.radio import csv_of, made
from tests.support.refusals import refused_input

WALLED = ROOT / "scenarios" / "flocking-802154.toml"
REPLAYED = ROOT / "scenarios" / "replayed-links.toml"
HEAD = "t_s,tx,rx,seq,rssi_dbm,distance_m\n"
SMALL = HEAD + "".join(f"{i},a,b,{i},{-50 - i},{1 + i}\n" for i in range(20))


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def output_of(*arguments: str | Path) -> str:
    done = CliRunner().invoke(app, ["radio", "probe", *map(str, arguments)])
    if done.exception is not None:
        raise done.exception
    return done.stdout


def contention(*arguments: str) -> dict[str, float]:
    return json.loads(output_of(*arguments, "--runs", "2"))


def coverage(*arguments: str | Path) -> dict[str, Any]:
    return json.loads(output_of(*arguments, "--json"))


def test_contention_costs_delivery_and_time():
    few, many = (contention("ieee802154", "--contention", f"{nodes},20,0.1") for nodes in (2, 40))
    assert few["pdr"] > 0.95 > many["pdr"]
    assert few["mean_delay_s"] < many["mean_delay_s"]


def test_values_of_the_radio_may_be_set():
    assert contention("ideal", "--contention", "3,20,0.1", "--set", "radio.loss=1.0")["pdr"] == 0.0


def test_disk_radio_covers_its_circle_from_the_given_position_or_robot():
    summary = coverage(LOSSY, "--at", "-1,0", "--seed", "4")
    assert (summary["seed"], summary["range_m"]) == (4, 2.0)
    assert summary["sensitivity_dbm"] is summary["map"]["mean_dbm"] is None
    assert summary["map"]["at_m"] == [-1.0, 0.0]
    assert 0.15 < summary["in_range_share"] < 3.15 * 2.0**2 / 64
    assert summary["by_distance"]["delivery"]["high"][0] == 0.7
    assert summary["by_distance"]["delivery"]["high"][-1] == 0.0
    robots = [coverage(LOSSY, *which)["map"]["at_m"] for which in ((), ("--from", "flock-0"), ("--from", "flock-19"))]
    assert robots[0] == robots[1] != robots[2]


def test_signals_have_a_strength_that_walls_and_distance_take():
    summary = coverage(WALLED, "--at", "0,1", "--bytes", "20", "--set", "radio.walls.crossing_db=60")
    x_m, y_m, mean_dbm = (summary["map"][name] for name in ("x_m", "y_m", "mean_dbm"))
    column = min(range(len(x_m)), key=lambda i: abs(x_m[i]))
    below, above = (mean_dbm[min(range(len(y_m)), key=lambda i: abs(y_m[i] - y))][column] for y in (2.5, 3.5))
    assert above < below - 55.0
    assert summary["payload_bytes"] == 20
    strength = summary["by_distance"]["mean_dbm"]["mean"]
    assert strength[0] > strength[-1]


def test_coverage_of_a_robot_has_the_power_of_its_group():
    lead = ROOT / "scenarios" / "jammed.toml", "--from", "lead-0", "--set"
    base, strong = (coverage(*lead, f"robots.lead.radio.power_dbm={dbm}") for dbm in (-25.0, -5.0))
    assert base["map"]["at_m"] == strong["map"]["at_m"]
    by_distance = [summary["by_distance"]["mean_dbm"]["mean"] for summary in (base, strong)]
    assert by_distance[1][5] == pytest.approx(by_distance[0][5] + 20.0)


@pytest.mark.parametrize(
    ("arguments", "where", "key"),
    [
        (("x", "--contention", "2,20,0.1"), "radio", ""),
        (("unit-disk", "--contention", "1,20,0.1"), "--contention", ""),
        (("unit-disk",), "--contention", ""),
        (("unit-disk", "--at", "0,0"), "--at", ""),
        (("ideal", "--contention", "2,20,0.1", "--set", "radio.trace.file=a.csv"), "radio", "radio.trace"),
        ((LOSSY, "--contention", "2,20,0.1"), "--contention", ""),
        ((LOSSY, "--at", "0,9"), "--at", ""),
        ((LOSSY, "--at", "nan,0"), "--at", ""),
        ((LOSSY, "--at", "1"), "--at", ""),
        ((LOSSY, "--at", "1,1", "--from", "flock-0"), "--from", ""),
        ((LOSSY, "--from", "flock-20"), "--from", ""),
        ((LOSSY, "--bytes", "101"), "--bytes", ""),
        ((LOSSY, "--to", "a.txt"), "a.txt", ""),
        ((ROOT / "scenarios" / "avoidance.toml",), str(ROOT / "scenarios" / "avoidance.toml"), "radio"),
        ((REPLAYED,), str(REPLAYED), "radio.trace.others"),
    ],
)
def test_probe_arguments_that_are_invalid_are_refused(arguments, where, key):
    with refused_input(where, key):
        output_of(*arguments)


def test_fit_of_a_log_gives_a_table_a_picture_and_a_radio_for_a_scenario(folder, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    (folder / "log.csv").write_text(csv_of(made(1, Shadowing(4.0, 5.0), Bursts(0.5, 5.0), packets=60)))
    to = ["--to", "fit.png", "--to", "radio.toml", "--power-dbm", "4"]
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", *to)
    assert (code, errors) == (0, "")
    for words in ("path loss exponent", "standard error", "correlation distance", "bursts: mean", "root mean square"):
        assert words in out
    assert out.endswith("written: fit.png\nwritten: radio.toml\n")
    assert (folder / "fit.png").read_bytes().startswith(b"\x89PNG")
    radio = tomllib.loads((folder / "radio.toml").read_text())["radio"]
    assert sorted(radio) == ["antenna", "bursts", "log_distance", "model", "shadowing"]
    assert 42.0 < radio["log_distance"]["reference_loss_db"] < 46.0


def test_people_get_a_table_and_a_picture(tmp_path):
    text = output_of(WALLED, "--to", tmp_path / "coverage.png")
    assert "sensitivity -101.0 dBm" in text
    assert "% of the arena in range" in text
    assert max(len(line) for line in text.splitlines() if "│" in line) <= 80
    assert text.splitlines()[-1] == f"written: {tmp_path / 'coverage.png'}"
    assert (tmp_path / "coverage.png").read_bytes().startswith(b"\x89PNG")
    json.loads(output_of(LOSSY, "--json", "--to", tmp_path / "disk.svg").splitlines()[0])
    assert "</svg>" in (tmp_path / "disk.svg").read_text()


def test_without_a_file_the_table_is_printed_and_what_is_left_out_is_named(folder, monkeypatch, capsys):
    (folder / "log.csv").write_text(SMALL)
    code, out, _ = called(monkeypatch, capsys, "radio", "fit", "log.csv")
    assert code == 0
    assert "20 packets on 1 link, 20 received" in out
    for text in ("shadowing: needs positions", "losses: needs 100 packets, got 20"):
        assert f"left out: {text}" in out
    assert "log_distance" in tomllib.loads(out[out.index("# Fitted to") :])["radio"]


def rows(count, rssi_dbm, distance_m, received=lambda _: True):
    lines = (f"{i},a,b,{i},{rssi_dbm(i) if received(i) else ''},{distance_m(i)}\n" for i in range(count))
    return HEAD + "".join(lines)


def falling(i):
    return -50.0 - 30.0 * math.log10(1 + i % 20)


LOGS = {
    "falls": rows(200, falling, lambda i: 1 + i % 20),
    "strong": rows(200, lambda i: 90.0 + falling(i), lambda i: 1 + i % 20),
    "rises": rows(200, lambda i: -60 + i % 20, lambda i: 1 + i % 20),
    "one-place": rows(200, lambda _: -60, lambda _: 2, lambda i: i % 7),
    "bursts": rows(2000, lambda _: -60, lambda _: 2, lambda i: i % 50 > 9),
    "far": rows(200, falling, lambda i: 10.0 ** (i % 20)),
}


@pytest.mark.parametrize("name", LOGS)
def test_fitted_radio_is_accepted_in_a_scenario(folder, monkeypatch, capsys, name):
    (folder / "log.csv").write_text(LOGS[name])
    code, _, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", "--to", "radio.toml")
    assert (code, errors) == (0, "")
    text = (folder / "radio.toml").read_text()
    radio = tomllib.loads(text)["radio"]
    scenario = tomllib.loads((ROOT / "scenarios" / "flocking-lossy.toml").read_text())
    complete = "model" in radio
    assert complete == (name in ("falls", "strong"))
    assert ("# Without path loss this is no radio yet" in text) == ("# Left out: path loss: " in text) == (not complete)
    base = {} if complete else {"range_m": 2.0}
    accepted = scenario_from({**scenario, "radio": {**base, **radio}}, "radio.toml").radio
    assert accepted is not None
    assert ("bursts" in radio) == (name == "bursts")


@pytest.mark.parametrize(
    ("text", "reasons"),
    [
        (f"{HEAD}0,a,b,0,-50,1\n", ("path loss: needs 10 ", "losses: needs 100 ")),
        (rows(150, falling, lambda _: 2, lambda _: False), ("got 0", "losses: .*150")),
        (rows(50, lambda _: -60, lambda _: 2), ("path loss: .*distances", "losses: needs 100 ")),
        (rows(50, lambda _: -60, lambda i: 1 + i), ("path loss: RSSI", "losses: needs 100 ")),
    ],
)
def test_log_that_allows_no_fit_is_refused_with_the_reasons(folder, monkeypatch, capsys, text, reasons):
    (folder / "log.csv").write_text(text)
    for reason in reasons:
        fit = ("radio", "fit", "log.csv", "--to", "radio.toml")
        refused_command(monkeypatch, capsys, *fit, match=f"log.csv: .*{reason}")
    assert not (folder / "radio.toml").exists()


def test_fit_beyond_what_a_scenario_takes_is_refused_with_the_key(folder, monkeypatch, capsys):
    slow = (f"{i * 1e6},a,b,{i},{-60 if i % 50 > 9 else ''},2\n" for i in range(2000))
    (folder / "log.csv").write_text(HEAD + "".join(slow))
    refused_command(monkeypatch, capsys, "radio", "fit", "log.csv", match="log.csv: fitted radio.bursts.")


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (["log.csv", "--power-dbm", "nan"], "--power-dbm"),
        (["log.csv", "--gain-dbi", "nan"], "--gain-dbi"),
        (["log.csv", "--power-dbm", "inf"], "--power-dbm"),
        (["absent.csv"], "absent.csv"),
        (["log.csv", "--to", "radio.json"], "radio.json"),
        (["log.csv", "--to", "absent/radio.toml"], "absent/radio.toml"),
        (["log.csv", "--to", "fit.bmp"], "fit.bmp"),
        (["log.csv", "--within", "0.5"], "--within"),
    ],
)
def test_fit_options_that_are_invalid_are_refused_in_one_line(folder, monkeypatch, capsys, arguments, where):
    (folder / "log.csv").write_text(SMALL)
    refused_command(monkeypatch, capsys, "radio", "fit", *arguments, match=f"{where}: ")
