"""Radio commands: probe, and pictures of the radio."""

import json
import math
import tomllib
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.config.impairments import Bursts
from swarmwire.comms.radio.config.phy import Shadowing
from swarmwire.deploy.cli.app import app
from tests.integration.deploy.radio.test_radio_fit import here, rows
from tests.support.deploy.runs import LOSSY, ROOT, called
from tests.support.metrics.radio import csv_of, made

WALLED = ROOT / "scenarios" / "flocking-802154.toml"
REPLAYED = ROOT / "scenarios" / "replayed-links.toml"
__all__ = ["here"]  # in whose folder all of these tests are


def said(*arguments: str | Path) -> str:
    done = CliRunner().invoke(app, ["radio", "probe", *map(str, arguments)])
    if done.exception is not None:
        raise done.exception
    return done.stdout


def contention(*arguments: str) -> dict[str, float]:
    return json.loads(said(*arguments, "--runs", "2", "--measured-s", "0.5"))


def coverage(*arguments: str | Path) -> dict[str, Any]:
    return json.loads(said(*arguments, "--json"))


def test_contention_costs_delivery_and_time():
    few, many = (contention("ieee802154", "--contention", f"{nodes},20,0.1") for nodes in (2, 40))
    assert few["delivery_ratio"] > 0.95 > many["delivery_ratio"]
    assert few["mean_delay_s"] < many["mean_delay_s"]


def test_values_of_the_radio_may_be_set():
    assert contention("ideal", "--contention", "3,20,0.1", "--set", "radio.loss=1.0")["delivery_ratio"] == 0.0


def test_a_disk_covers_its_circle_from_the_place_or_the_robot():
    found = coverage(LOSSY, "--at", "-1,0", "--seed", "4")
    assert (found["seed"], found["range_m"], found["sensitivity_dbm"], found["map"]["mean_dbm"]) == (4, 2.0, None, None)
    assert found["map"]["at_m"] == [-1.0, 0.0]
    assert 0.15 < found["in_range_share"] < 3.15 * 2.0**2 / 64
    assert found["by_distance"]["delivery"]["high"][0] == 0.7
    assert found["by_distance"]["delivery"]["high"][-1] == 0.0
    robots = [coverage(LOSSY, *which)["map"]["at_m"] for which in ((), ("--from", "flock-0"), ("--from", "flock-19"))]
    assert robots[0] == robots[1] != robots[2]


def test_signals_have_a_strength_that_walls_and_distance_take():
    found = coverage(WALLED, "--at", "0,1", "--bytes", "20", "--set", "radio.walls.crossing_db=60")
    x_m, y_m, mean_dbm = (found["map"][name] for name in ("x_m", "y_m", "mean_dbm"))
    column = min(range(len(x_m)), key=lambda i: abs(x_m[i]))
    below, above = (mean_dbm[min(range(len(y_m)), key=lambda i: abs(y_m[i] - y))][column] for y in (2.5, 3.5))
    assert above < below - 55.0
    assert found["payload_bytes"] == 20
    strength = found["by_distance"]["mean_dbm"]["mean"]
    assert strength[0] > strength[-1]


def test_a_robot_that_sends_does_so_with_the_power_of_its_group():
    jammed = ROOT / "scenarios" / "jammed.toml"
    base, strong = (
        coverage(jammed, "--from", "lead-0", "--set", f"robots.lead.radio.power_dbm={dbm}") for dbm in (-25.0, -5.0)
    )
    assert base["map"]["at_m"] == strong["map"]["at_m"]
    by_distance = [found["by_distance"]["mean_dbm"]["mean"] for found in (base, strong)]
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
def test_what_makes_no_probe_is_refused(arguments, where, key):
    with pytest.raises(BadInput) as error:
        said(*arguments)
    assert (error.value.where, error.value.key) == (where, key)


def test_a_log_becomes_a_table_a_picture_and_what_stands_in_a_scenario(here, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    (here / "log.csv").write_text(csv_of(made(1, Shadowing(4.0, 5.0), Bursts(0.5, 5.0), packets=60)))
    to = ["--to", "fit.png", "--write", "radio.toml", "--power-dbm", "4", "--size", "400"]
    code, out, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", *to)
    assert (code, errors) == (0, "")
    for words in ("path loss exponent", "standard error", "correlation distance", "bursts: mean", "root mean square"):
        assert words in out
    assert out.endswith("written: fit.png\nwritten: radio.toml\n")
    assert (here / "fit.png").read_bytes().startswith(b"\x89PNG")
    radio = tomllib.loads((here / "radio.toml").read_text())["radio"]
    assert sorted(radio) == ["antenna", "bursts", "log_distance", "model", "shadowing"]
    assert 42.0 < radio["log_distance"]["reference_loss_db"] < 46.0


@pytest.mark.parametrize("farthest_m", [2.0, 9.0, 15.5, 400.0, 1e6])
def test_the_picture_has_distances_to_read_off(here, monkeypatch, capsys, farthest_m):
    pytest.importorskip("matplotlib", reason="needs the extra [report]")
    from swarmwire.metrics.drawing import canvas, radio_fit

    drawn = []
    monkeypatch.setattr(radio_fit, "save", lambda figure, to: (drawn.append(figure), canvas.save(figure, to)))
    step = math.log10(farthest_m / 1.2) / 19
    (here / "log.csv").write_text(rows(20, lambda i: -50 - 30 * step * i, lambda i: 1.2 * 10.0 ** (step * i)))
    code, _, errors = called(monkeypatch, capsys, "radio", "fit", "log.csv", "--to", "fit.png", "--size", "400")
    assert (code, errors) == (0, "")
    axis, (low, high) = drawn[0].axes[0].xaxis, drawn[0].axes[0].get_xlim()
    shown = [label.get_text() for label in axis.get_ticklabels() if low <= label.get_position()[0] <= high]
    assert 2 <= len([text for text in shown if text]) <= 20


def test_people_get_a_table_and_a_picture(tmp_path):
    text = said(WALLED, "--to", tmp_path / "coverage.png", "--size", "400")
    assert "sensitivity -101.0 dBm" in text
    assert "% of the arena in range" in text
    assert max(len(line) for line in text.splitlines() if "│" in line) <= 80
    assert text.splitlines()[-1] == f"written: {tmp_path / 'coverage.png'}"
    assert (tmp_path / "coverage.png").read_bytes().startswith(b"\x89PNG")
    json.loads(said(LOSSY, "--json", "--to", tmp_path / "disk.svg").splitlines()[0])
    assert "</svg>" in (tmp_path / "disk.svg").read_text()
