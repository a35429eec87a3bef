"""Tables of bodies and of the radio."""

from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.radio.config.antennas import RobotAntenna
from swarmwire.comms.radio.config.impairments import Bursts, bursts_from_steps
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.placement.maps import path_near_scenario
from swarmwire.world.scenario.bodies import bodies_of, custom_code_of, read_body, sheet_path
from swarmwire.world.scenario.scenario import Scenario, mapping_of
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors import loading
from tests.support.refusals import refused_input
from tests.support.world.scenes import SAMPLE

SIGNAL, BLE = {"model": "log-distance"}, {"preset": "ble-1M"}
BURST_FAULTS: dict[str, list[dict[str, float]]] = {  # by the key below radio.bursts
    "p": [
        {"p": 0.1, "r": 0.5, "interval_s": 0.1, "bad_s": 1.0},
        {"interval_s": 0.1},
        {"p": 1.0, "r": 0.5, "interval_s": 1.0},
        {"mean_loss": 0.1, "p": 0.1},
    ],
    "interval_s": [{"p": 0.1, "r": 0.5}],
    "r": [{"p": 0.5, "r": 0.5, "interval_s": 1.0}],
    "mean_loss": [
        {"mean_loss": 0.1, "good_s": 1.0},
        {"mean_loss": 1.0},
        {"mean_loss": 0.5, "loss_bad": 0.5},
        {"mean_loss": 0.1, "loss_good": 0.2},
        {"mean_loss": 1e-9},
    ],
    "loss_bad": [{"loss_bad": 0.1, "loss_good": 0.2}],
}
FAULTS: list[tuple[dict[str, Any], str]] = [
    *(({**SIGNAL, "bursts": table}, f"radio.bursts.{key}") for key, tables in BURST_FAULTS.items() for table in tables),
    ({}, "radio.range_m"),
    ({"preset": "nothing"}, "radio.preset"),
    ({"range_m": 2.0, "access": {}}, "radio.access"),
    ({"range_m": 2.0, "reception": {}}, "radio.reception"),
    ({"range_m": 2.0, "measures": {"rssi": {}}}, "radio.measures.rssi"),
    ({"preset": "unit-disk", "fading": {}}, "radio.fading"),
    ({**SIGNAL, "two_ray": {}}, "radio.two_ray"),
    ({**SIGNAL, "bit_rate_bps": 0}, "radio.bit_rate_bps"),
    ({**SIGNAL, "walls": {}, "line_of_sight": True}, "radio.walls"),
    ({**SIGNAL, "bodies_block": True}, "radio.bodies_block"),
    ({**SIGNAL, "access": {"method": "dcf"}}, "radio.access.method"),
    ({**SIGNAL, "frame": "802.11b"}, "radio.bit_rate_bps"),
    ({**SIGNAL, "reception": {"model": "table"}}, "radio.reception.table"),
    ({**SIGNAL, "delays": {"distribution": "uniform", "deviation_s": 1.0}}, "radio.delays.deviation_s"),
    ({"preset": "ieee802154", "model": "unit-disk", "range_m": 1.0}, "radio.antenna"),
    ({"preset": "gilbert", "bursts": {"r": 0.5}}, "radio.bursts.r"),
    ({"range_m": 2.0, "cut_off_db": 3.0}, "radio.cut_off_db"),
    ({**SIGNAL, "access": {"method": "aloha", "max_retries": 3}}, "radio.access.max_retries"),
    ({**SIGNAL, "access": {"method": "none", "cca_threshold_dbm": -70.0}}, "radio.access.cca_threshold_dbm"),
    ({"range_m": 2.0, "queue_lifetime_s": 0.5}, "radio.queue_lifetime_s"),
    ({**SIGNAL, "access": {"method": "csma-802154", "cca_time_s": 1e-6}}, "radio.access.cca_time_s"),
    ({**SIGNAL, "access": {"method": "aloha", "cca_sensitivity_dbm": -82.0}}, "radio.access.cca_sensitivity_dbm"),
    ({**SIGNAL, "reception": {"min_sinr_db": 3.0}}, "radio.reception.min_sinr_db"),
    ({**SIGNAL, "fading": {"distribution": "nakagami", "k": 3.0}}, "radio.fading.k"),
    ({**SIGNAL, "fading": {"distribution": "rician", "m": 1.0}}, "radio.fading.m"),
    ({"preset": "wifi-b-1M", "reception": {"model": "802.15.4"}}, "radio.reception.model"),
    *(
        ({"preset": "wifi-a-6M", "access": {key: value}}, f"radio.access.{key}")  # of 802.11n
        for key, value in (("aggregation_bytes", 100), ("rts_threshold_bytes", 100), ("rate_control", "ideal"))
    ),
    ({"preset": "ieee802154", "access": {"station": "ground"}}, "radio.access.station"),
    ({**BLE, "advertising": {"scan_window_s": 0.04}}, "radio.advertising.scan_window_s"),
    ({**BLE, "advertising": {"channels": 4}}, "radio.advertising.channels"),
    ({**BLE, "advertising": {}, "access": {"method": "aloha"}}, "radio.advertising"),
    ({**BLE, "advertising": {}, "model": "unit-disk", "range_m": 2.0}, "radio.antenna"),
]


def test_sheet_path_is_beside_the_scenario_and_none_for_a_name(tmp_path):
    scenario = str(tmp_path / "swarm.toml")
    assert sheet_path("epuck", scenario) is None
    assert sheet_path("mine.toml", scenario) == path_near_scenario(scenario, "mine.toml") == tmp_path / "mine.toml"
    elsewhere = "/else/mine.toml"
    assert sheet_path(elsewhere, scenario) == path_near_scenario(scenario, elsewhere) == Path(elsewhere)


def test_sheet_extends_a_shipped_body(tmp_path):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nname = "mine"\nmass_kg = 1.0\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert (body.name, body.mass_kg, body.drive) == ("mine", 1.0, load_body("epuck").drive)


def test_custom_code_is_listed_once(tmp_path):
    kind = "tests.support.custom_code:Alone"
    (tmp_path / "mine.toml").write_text(f'like = "epuck"\nsensors.x.kind = "{kind}"\nsensors.y.kind = "{kind}"\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert custom_code_of([load_body("epuck"), body, body]) == (kind,)


@pytest.mark.parametrize(
    ("spec", "key", "file"), [(None, "robots.flock.body", "swarm.toml"), ("mass_kg =", "", "mine.toml")]
)
def test_unreadable_sheet_is_refused(tmp_path, spec, key, file):
    if spec is not None:
        (tmp_path / "mine.toml").write_text(spec)
    with refused_input(key=key, match=rf"\b{file}: "):
        read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")


def bodies(tmp_path: Path, body: str, spec: dict[str, object]):
    """The bodies of two groups, of which only the first has a `spec`."""
    group = {"body": body, "count": 1, "agent": "a:A"}
    robots = {"worn": {**group, "body_overrides": spec}, "new": group}
    arena = {"size_m": [2.0, 2.0]}
    mapping = {"format": 1, "name": "s", "duration_s": 1.0, "arena": arena, "robots": robots}
    where = str(tmp_path / "swarm.toml")
    return bodies_of(scenario_from(mapping, where), where)


@pytest.mark.parametrize("body", ["epuck", "mine.toml"])
def test_body_overrides_change_one_group(tmp_path, body):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nmass_kg = 1.0\n')
    built = bodies(tmp_path, body, {"sensors": {"proximity": {"drop_out": 0.5}}})
    worn, new = built["worn"], built["new"]
    assert new.proximity is not None
    assert worn.proximity == replace(new.proximity, drop_out=0.5)
    assert worn.name == f"{new.name} of worn"
    assert (worn.mass_kg, worn.drive, worn.compass) == (new.mass_kg, new.drive, new.compass)


@pytest.mark.parametrize(
    ("spec", "key"),
    [
        ({"sensors": {"proximity": {"drop_out": 2}}}, "robots.worn.body_overrides.sensors.proximity.drop_out"),
        ({"weight_kg": 1.0}, "robots.worn.body_overrides.weight_kg"),
        ({"sensors": {"x": {"kind": "tests.support.custom_code:Alone"}}}, "robots.worn.body_overrides"),
    ],
)
def test_impossible_body_overrides_are_refused_with_their_key(tmp_path, spec, key):
    with refused_input(tmp_path / "swarm.toml", key):
        bodies(tmp_path, "epuck", spec)


def test_body_overrides_change_a_custom_sensor_of_an_entry_point(tmp_path, monkeypatch):
    point = EntryPoint("painted", "tests.support.custom_code:Paint", "swarmwire.sensors")
    monkeypatch.setattr(loading, "entry_points_of", lambda _: [point])
    (tmp_path / "mine.toml").write_text('like = "epuck"\nsensors.paint.kind = "painted"\n')
    worn = bodies(tmp_path, "mine.toml", {"sensors": {"paint": {"cells": 2}}})["worn"]
    assert custom_code_of([worn]) == ("tests.support.custom_code:Paint",)
    with refused_input(tmp_path / "swarm.toml", "robots.worn.body_overrides.sensors.paint.cells"):
        bodies(tmp_path, "mine.toml", {"sensors": {"paint": {"cells": 0}}})


def with_radio(table: dict[str, Any]) -> tuple[Scenario, Radio]:
    """The sample scenario with this radio."""
    scenario = scenario_from({**SAMPLE, "radio": table}, "f")
    assert scenario.radio is not None
    return scenario, scenario.radio


def radio_of(table: dict[str, Any]) -> Radio:
    return with_radio(table)[1]


@pytest.mark.parametrize("name", PRESETS)
def test_radio_preset_has_a_source(name: str) -> None:
    assert radio_of({"preset": name}).preset == name
    assert PRESETS[name].source


def test_radio_keys_override_their_preset() -> None:
    radio = radio_of({"preset": "ieee802154", "loss": 0.1, "log_distance": {"reference_loss_db": 50.0}})
    assert radio.loss == 0.1
    assert radio.log_distance is not None
    assert (radio.log_distance.exponent, radio.log_distance.reference_loss_db) == (3.0, 50.0)
    assert radio.access_or_default.method == "csma-802154"


STEPS = {"p": 0.02, "r": 0.2, "loss_bad": 0.8, "loss_good": 0.01, "interval_s": 0.1}
BURSTS: list[tuple[dict[str, float], Bursts]] = [
    ({"good_s": 3.0}, Bursts(good_s=3.0)),
    (STEPS, bursts_from_steps(0.02, 0.2, 0.8, 0.01, 0.1)),  # netem `gemodel 2% 20% 80% 1%`, packets every 100 ms
    ({"mean_loss": 0.0, "loss_good": 0.0}, Bursts(loss_bad=0.0, loss_good=0.0)),
    ({"mean_loss": 0.25, "loss_good": 0.25}, Bursts(loss_bad=0.25, loss_good=0.25)),
]


@pytest.mark.parametrize(("table", "bursts"), BURSTS)
def test_bursts_are_those_of_the_table_which_is_kept(table: dict[str, float], bursts: Bursts) -> None:
    scenario, radio = with_radio({"range_m": 2.0, "bursts": table})
    assert radio.bursts is not None
    if "mean_loss" in table:
        assert (radio.bursts.loss_bad, radio.bursts.loss) == (bursts.loss_bad, bursts.loss_good)
    else:
        assert radio.bursts == bursts
    assert mapping_of(scenario)["radio"]["bursts"] == table
    in_python = scenario.model_copy(update={"name": "another"})
    assert scenario_from(mapping_of(in_python), "g").radio == radio


@pytest.mark.parametrize("mean", [0.1, 0.3, 0.79])
@pytest.mark.parametrize(("loss_bad", "loss_good"), [(1.0, 0.0), (0.8, 0.05)])
def test_bursts_have_the_mean_loss_of_the_table(mean: float, loss_bad: float, loss_good: float) -> None:
    table = {"bad_s": 2.0, "mean_loss": mean, "loss_bad": loss_bad, "loss_good": loss_good}
    bursts = radio_of({"range_m": 2.0, "bursts": table}).bursts
    assert bursts is not None
    assert (bursts.bad_s, bursts.loss_bad, bursts.loss_good) == (2.0, loss_bad, loss_good)
    assert bursts.loss == pytest.approx(mean, rel=1e-12)


def test_radio_model_replaces_the_path_loss_of_the_preset() -> None:
    radio = radio_of({"preset": "ieee802154", "model": "friis"})
    assert (radio.model, radio.log_distance) == ("friis", None)
    assert radio.access_or_default.method == "csma-802154"


@pytest.mark.parametrize(("table", "key"), FAULTS)
def test_radio_contradiction_is_refused_with_its_key(table: dict[str, Any], key: str) -> None:
    with refused_input("f", key):
        radio_of(table)


def test_group_antenna_is_for_a_radio_with_signals() -> None:
    table = {**SAMPLE, "radio": SIGNAL}
    robots = {**SAMPLE["robots"], "big": {**SAMPLE["robots"]["big"], "radio": {"power_dbm": -10.0}}}
    scenario = scenario_from({**table, "robots": robots}, "f")
    assert scenario.robots["big"].radio == RobotAntenna(power_dbm=-10.0)
    assert scenario.robots["flock"].radio is None
    mute = {key: value for key, value in SAMPLE.items() if key != "radio"}
    strong = {**robots, "big": {**robots["big"], "radio": {"power_dbm": 1000.0}}}
    for mapping, key in (
        ({**SAMPLE, "robots": robots}, "robots.big.radio"),
        ({**mute, "robots": robots}, "robots.big.radio"),
        ({**table, "robots": strong}, "robots.big.radio.power_dbm"),
    ):
        with refused_input(key=key):
            scenario_from(mapping, "f")
