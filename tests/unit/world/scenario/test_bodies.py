"""Tables of bodies and of the radio."""

from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.radio.config.impairments import Bursts, bursts_from_steps
from swarmwire.comms.radio.config.phy import RobotAntenna
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.robot.bodies.body import load_body
from swarmwire.world.placement.maps import path_near_scenario
from swarmwire.world.scenario.bodies import bodies_of, custom_code_of, read_body, sheet_path
from swarmwire.world.scenario.scenario import mapping_of
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.sensors import loading
from tests.support.world.scenes import SAMPLE

SIGNAL = {"model": "log-distance"}
FAULTS: list[tuple[dict[str, Any], str]] = [
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
    ({**SIGNAL, "bursts": {"p": 0.1, "r": 0.5, "interval_s": 0.1, "bad_s": 1.0}}, "radio.bursts.p"),
    ({"preset": "gilbert", "bursts": {"r": 0.5}}, "radio.bursts.r"),
    ({**SIGNAL, "bursts": {"p": 0.1, "r": 0.5}}, "radio.bursts.interval_s"),
    ({**SIGNAL, "bursts": {"interval_s": 0.1}}, "radio.bursts.p"),
    ({**SIGNAL, "bursts": {"p": 0.5, "r": 0.5, "interval_s": 1.0}}, "radio.bursts.r"),
    ({**SIGNAL, "bursts": {"p": 1.0, "r": 0.5, "interval_s": 1.0}}, "radio.bursts.p"),
    ({**SIGNAL, "bursts": {"mean_loss": 0.1, "good_s": 1.0}}, "radio.bursts.mean_loss"),
    ({**SIGNAL, "bursts": {"mean_loss": 0.1, "p": 0.1}}, "radio.bursts.p"),
    ({**SIGNAL, "bursts": {"mean_loss": 1.0}}, "radio.bursts.mean_loss"),
    ({**SIGNAL, "bursts": {"mean_loss": 0.5, "loss_bad": 0.5}}, "radio.bursts.mean_loss"),
    ({**SIGNAL, "bursts": {"mean_loss": 0.1, "loss_good": 0.2}}, "radio.bursts.mean_loss"),
    ({**SIGNAL, "bursts": {"mean_loss": 1e-9}}, "radio.bursts.mean_loss"),
    ({"range_m": 2.0, "cut_off_db": 3.0}, "radio.cut_off_db"),
    ({**SIGNAL, "bursts": {"loss_bad": 0.1, "loss_good": 0.2}}, "radio.bursts.loss_bad"),
    ({**SIGNAL, "access": {"method": "aloha", "max_retries": 3}}, "radio.access.max_retries"),
    ({**SIGNAL, "access": {"method": "none", "cca_threshold_dbm": -70.0}}, "radio.access.cca_threshold_dbm"),
    ({"range_m": 2.0, "queue_lifetime_s": 0.5}, "radio.queue_lifetime_s"),
    ({**SIGNAL, "access": {"method": "csma-802154", "cca_time_s": 1e-6}}, "radio.access.cca_time_s"),
    ({**SIGNAL, "access": {"method": "aloha", "cca_sensitivity_dbm": -82.0}}, "radio.access.cca_sensitivity_dbm"),
    ({**SIGNAL, "reception": {"min_sinr_db": 3.0}}, "radio.reception.min_sinr_db"),
    ({**SIGNAL, "fading": {"distribution": "nakagami", "k": 3.0}}, "radio.fading.k"),
    ({**SIGNAL, "fading": {"distribution": "rician", "m": 1.0}}, "radio.fading.m"),
    ({"preset": "wifi-b-1M", "reception": {"model": "802.15.4"}}, "radio.reception.model"),
]


def test_a_name_has_no_file_and_a_sheet_lies_beside_the_scenario(tmp_path):
    scenario = str(tmp_path / "swarm.toml")
    assert sheet_path("epuck", scenario) is None
    assert sheet_path("mine.toml", scenario) == path_near_scenario(scenario, "mine.toml") == tmp_path / "mine.toml"
    assert (
        sheet_path("/else/mine.toml", scenario)
        == path_near_scenario(scenario, "/else/mine.toml")
        == Path("/else/mine.toml")
    )


def test_a_sheet_may_start_from_a_body_that_comes_with_swarmwire(tmp_path):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nname = "mine"\nmass_kg = 1.0\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert (body.name, body.mass_kg, body.drive) == ("mine", 1.0, load_body("epuck").drive)


def test_a_class_that_bodies_name_is_listed_once(tmp_path):
    kind = "tests.support.custom_code:Alone"
    (tmp_path / "mine.toml").write_text(f'like = "epuck"\nsensors.x.kind = "{kind}"\nsensors.y.kind = "{kind}"\n')
    body = read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert custom_code_of([load_body("epuck"), body, body]) == (kind,)


@pytest.mark.parametrize(
    ("spec", "said"),
    [(None, "swarm.toml: robots.flock.body: expected a readable file"), ("mass_kg =", "mine.toml: expected TOML")],
)
def test_a_sheet_that_cannot_be_read_is_named_by_whoever_names_it(tmp_path, spec, said):
    if spec is not None:
        (tmp_path / "mine.toml").write_text(spec)
    with pytest.raises(BadInput) as caught:
        read_body(tmp_path / "mine.toml", "swarm.toml", "robots.flock.body")
    assert said in str(caught.value)


def bodies(tmp_path: Path, body: str, spec: dict[str, object]):
    """The bodies of two groups, of which only the first has a `spec`."""
    group = {"body": body, "count": 1, "agent": "a:A"}
    robots = {"worn": {**group, "body_overrides": spec}, "new": group}
    arena = {"size_m": [2.0, 2.0]}
    mapping = {"format": 1, "name": "s", "duration_s": 1.0, "arena": arena, "robots": robots}
    where = str(tmp_path / "swarm.toml")
    return bodies_of(scenario_from(mapping, where), where)


@pytest.mark.parametrize("body", ["epuck", "mine.toml"])
def test_a_scenario_changes_a_body_for_one_group(tmp_path, body):
    (tmp_path / "mine.toml").write_text('like = "epuck"\nmass_kg = 1.0\n')
    found = bodies(tmp_path, body, {"sensors": {"proximity": {"drop_out": 0.5}}})
    worn, new = found["worn"], found["new"]
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
def test_what_a_scenario_may_not_change_is_named(tmp_path, spec, key):
    with pytest.raises(BadInput) as caught:
        bodies(tmp_path, "epuck", spec)
    assert (caught.value.where, caught.value.key) == (str(tmp_path / "swarm.toml"), key)


def test_a_scenario_changes_parameters_of_a_users_own_sense_that_an_entry_point_names(tmp_path, monkeypatch):
    point = EntryPoint("painted", "tests.support.custom_code:Paint", "swarmwire.sensors")
    monkeypatch.setattr(loading, "entry_points_of", lambda _: [point])
    (tmp_path / "mine.toml").write_text('like = "epuck"\nsensors.paint.kind = "painted"\n')
    worn = bodies(tmp_path, "mine.toml", {"sensors": {"paint": {"cells": 2}}})["worn"]
    assert custom_code_of([worn]) == ("tests.support.custom_code:Paint",)
    with pytest.raises(BadInput, match="at least 1") as caught:
        bodies(tmp_path, "mine.toml", {"sensors": {"paint": {"cells": 0}}})
    assert caught.value.key == "robots.worn.body_overrides.sensors.paint.cells"
    assert caught.value.where == str(tmp_path / "swarm.toml")


def radio_of(table: dict[str, Any]) -> Radio:
    """The radio of the sample scenario with this table."""
    radio = scenario_from({**SAMPLE, "radio": table}, "f").radio
    assert radio is not None
    return radio


@pytest.mark.parametrize("name", PRESETS)
def test_every_preset_is_a_radio(name: str) -> None:
    radio = radio_of({"preset": name})
    assert radio.preset == name
    assert PRESETS[name].source


def test_what_a_scenario_says_wins_over_its_preset_key_by_key() -> None:
    radio = radio_of({"preset": "ieee802154", "loss": 0.1, "log_distance": {"reference_loss_db": 50.0}})
    assert radio.loss == 0.1
    assert radio.log_distance is not None
    assert (radio.log_distance.exponent, radio.log_distance.reference_loss_db) == (3.0, 50.0)
    assert radio.access_or_default.method == "csma-802154"


def test_bursts_may_be_given_by_steps_from_packet_to_packet() -> None:
    """As netem's gemodel 2% 20% 80% 1% for packets every 100 ms."""
    steps = {"p": 0.02, "r": 0.2, "loss_bad": 0.8, "loss_good": 0.01, "interval_s": 0.1}
    scenario = scenario_from({**SAMPLE, "radio": {"range_m": 2.0, "bursts": steps}}, "f")
    assert scenario.radio is not None
    bursts = scenario.radio.bursts
    assert bursts == bursts_from_steps(0.02, 0.2, 0.8, 0.01, 0.1)
    assert mapping_of(scenario)["radio"]["bursts"] == steps
    in_python = scenario.model_copy(update={"name": "another"})
    assert scenario_from(mapping_of(in_python), "g").radio == scenario.radio


@pytest.mark.parametrize("mean", [0.1, 0.3, 0.79])
@pytest.mark.parametrize(("loss_bad", "loss_good"), [(1.0, 0.0), (0.8, 0.05)])
def test_bursts_may_be_given_by_their_mean_loss(mean: float, loss_bad: float, loss_good: float) -> None:
    table = {"bad_s": 2.0, "mean_loss": mean, "loss_bad": loss_bad, "loss_good": loss_good}
    scenario = scenario_from({**SAMPLE, "radio": {"range_m": 2.0, "bursts": table}}, "f")
    assert scenario.radio is not None
    bursts = scenario.radio.bursts
    assert bursts is not None
    assert (bursts.bad_s, bursts.loss_bad, bursts.loss_good) == (2.0, loss_bad, loss_good)
    assert bursts.loss == pytest.approx(mean, rel=1e-12)
    assert mapping_of(scenario)["radio"]["bursts"] == table


@pytest.mark.parametrize("loss_good", [0.0, 0.25])
def test_a_mean_loss_no_greater_than_that_of_good_links_is_never_more(loss_good: float) -> None:
    table = {"mean_loss": loss_good, "loss_good": loss_good}
    scenario = scenario_from({**SAMPLE, "radio": {"range_m": 2.0, "bursts": table}}, "f")
    assert scenario.radio is not None
    bursts = scenario.radio.bursts
    assert bursts is not None
    assert (bursts.loss_bad, bursts.loss) == (loss_good, loss_good)
    in_python = scenario.model_copy(update={"name": "another"})
    assert scenario_from(mapping_of(in_python), "g").radio == scenario.radio


def test_spells_left_out_have_their_usual_length() -> None:
    assert radio_of({"range_m": 2.0, "bursts": {"good_s": 3.0}}).bursts == Bursts(good_s=3.0)


def test_another_model_than_the_presets_takes_the_presets_path_loss_with_it() -> None:
    radio = radio_of({"preset": "ieee802154", "model": "friis"})
    assert (radio.model, radio.log_distance) == ("friis", None)
    assert radio.access_or_default.method == "csma-802154"


@pytest.mark.parametrize(("table", "key"), FAULTS)
def test_a_contradiction_is_refused_with_its_key(table: dict[str, Any], key: str) -> None:
    with pytest.raises(BadInput) as caught:
        radio_of(table)
    assert (caught.value.where, caught.value.key) == ("f", key)


def test_groups_may_have_their_own_power_and_gain_of_a_radio_with_signals() -> None:
    table = {**SAMPLE, "radio": SIGNAL}
    own = {**SAMPLE["robots"], "big": {**SAMPLE["robots"]["big"], "radio": {"power_dbm": -10.0}}}
    scenario = scenario_from({**table, "robots": own}, "f")
    assert scenario.robots["big"].radio == RobotAntenna(power_dbm=-10.0)
    assert scenario.robots["flock"].radio is None
    mute = {key: value for key, value in SAMPLE.items() if key != "radio"}
    strong = {**own, "big": {**own["big"], "radio": {"power_dbm": 1000.0}}}
    for refused, key in (
        ({**SAMPLE, "robots": own}, "robots.big.radio"),
        ({**mute, "robots": own}, "robots.big.radio"),
        ({**table, "robots": strong}, "robots.big.radio.power_dbm"),
    ):
        with pytest.raises(BadInput) as caught:
            scenario_from(refused, "f")
        assert caught.value.key == key
