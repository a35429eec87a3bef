"""`swarmwire radio probe`: the figures by which radios are compared, and the coverage of a scenario's radio."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.cli.app import app
from tests.support.deploy.commands import LOSSY, ROOT

WALLED = ROOT / "scenarios" / "flocking-802154.toml"
REPLAYED = ROOT / "scenarios" / "replayed-links.toml"


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
