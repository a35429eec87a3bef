"""`swarmwire import`: ARGoS experiments as scenarios and agents."""

import ast
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from swarmwire.comms.base.config import read_toml
from swarmwire.deploy import run
from swarmwire.deploy.cli.actions.import_argos import convert_argos
from swarmwire.deploy.cli.app import app
from tests.support.refusals import refused_input

EXAMPLES = sorted((Path(__file__).parent / "argos3_examples").glob("*.argos"))
EXPERIMENT = """<?xml version="1.0" ?>
<argos-configuration>
  <framework><system threads="4" /><experiment length="90" ticks_per_second="20" random_seed="7" /></framework>
  <controllers>
    <my_rule_controller id="rule">
      <actuators>
        <differential_steering implementation="default" /><range_and_bearing implementation="default" />
        <footbot_gripper implementation="default" />
      </actuators>
      <sensors>
        <footbot_proximity implementation="default" noise_level="0.1" show_rays="true" />
        <range_and_bearing implementation="medium" medium="rab" noise_std_dev="0.2" packet_drop_prob="0.25" />
        <positioning implementation="default" /><footbot_turret_encoder implementation="default" />
      </sensors>
      <params velocity="5" eager="true"><state name="a:b" class="2.5" /></params>
    </my_rule_controller>
  </controllers>
  <arena size="10, 8, 2" center="5,4,1">
    <box id="wall" size="3,0.1,0.5" movable="false"><body position="5,7.98,0" orientation="0,0,0" /></box>
    <box id="turned" size="1,0.5,0.3" movable="true" mass="2.5"><body position="2,2,0" orientation="-90,0,0" /></box>
    <light id="lamp" position="8,1,2" orientation="0,0,0" color="yellow" intensity="1.5" medium="leds" />
    <prism id="odd" />
    <foot-bot id="fb_1" rab_range="4" rab_data_size="20">
      <body position="1,1,0" orientation="180,0,0" /><controller config="rule" />
    </foot-bot>
    <foot-bot id="fb_2" rab_range="4" rab_data_size="20">
      <body position="1,3,0" orientation="0,0,0" /><controller config="rule" />
    </foot-bot>
    <distribute>
      <position method="grid" center="6,4,0" distances="0.5,1,0" layout="3,2,1" />
      <orientation method="constant" values="45,0,0" />
      <entity quantity="5" max_trials="1"><e-puck id="ep"><controller config="rule" /></e-puck></entity>
    </distribute>
    <distribute>
      <position method="gaussian" mean="5,4,0" std_dev="1,2,0" />
      <orientation method="gaussian" mean="0,0,0" std_dev="360,0,0" />
      <entity quantity="4" max_trials="9"><foot-bot id="crowd"><controller config="rule" /></foot-bot></entity>
    </distribute>
    <distribute>
      <position method="uniform" min="0,0,0" max="4,2,0" />
      <orientation method="constant" values="0,0,0" />
      <entity quantity="3" max_trials="9"><cylinder id="c" height="0.5" radius="0.15" movable="false" /></entity>
    </distribute>
  </arena>
  <physics_engines><dynamics2d id="dyn2d" /></physics_engines>
  <media><range_and_bearing id="rab" check_occlusions="false" /></media>
</argos-configuration>
"""


def converted(folder: Path, text: str = EXPERIMENT) -> tuple[dict[str, Any], str, list[str]]:
    path = folder / "mine.argos"
    path.write_text(text)
    return convert_argos(path, "mine.py")


def test_argos_experiment_becomes_these_tables(tmp_path):
    """Worked out by hand; the grid after GridGenerator in ARGoS's space.cpp: greatest x and y first, x fastest."""
    scenario = converted(tmp_path)[0]
    assert (scenario["seed"], scenario["duration_s"], scenario["time"]) == (7, 90.0, {"rate_hz": 20})
    assert scenario["physics"] == {"engine": "pymunk"}
    arena = scenario["arena"]
    assert arena["size_m"] == [10.0, 8.06]  # the wall reaches to y = 8.03 - 4 m
    turned = {"movable": True, "mass_kg": 2.5, "heading_rad": pytest.approx(-pi / 2)}
    within = {"how": "box", "size_m": [4.0, 2.0], "at": [-3.0, -3.0]}
    assert arena["obstacles"] == [
        {"shape": "box", "size_m": [3.0, 0.1], "height_m": 0.5, "at": [0.0, 3.98]},
        {"shape": "box", "size_m": [1.0, 0.5], "height_m": 0.3, "at": [-3.0, -2.0], **turned},
        {"shape": "cylinder", "radius_m": 0.15, "height_m": 0.5, "count": 3, "place": "random", "within": within},
    ]
    assert arena["lights"] == [{"intensity": 1.5, "at": [3.0, -3.0]}]
    params = {"velocity": 5.0, "eager": True, "state_name": "a:b", "state_class": 2.5}
    robots = scenario["robots"]
    counts = {group: (table["body"], table["count"]) for group, table in robots.items()}
    assert counts == {"fb": ("footbot", 2), "ep": ("epuck", 5), "crowd": ("footbot", 4)}
    assert all(table["agent"] == "mine.py:MyRule" and table["params"] == params for table in robots.values())
    assert robots["fb"]["place"]["poses"] == [[-4.0, -3.0, pytest.approx(pi)], [-4.0, -1.0, 0.0]]
    poses = [(1.5, 0.5), (1.0, 0.5), (0.5, 0.5), (1.5, -0.5), (1.0, -0.5)]
    assert robots["ep"]["place"]["poses"] == [[x, y, pytest.approx(pi / 4)] for x, y in poses]
    deviation = np.array(robots["crowd"]["place"].pop("size_m")) / np.sqrt(12.0)  # of a uniform distribution
    assert deviation == pytest.approx([1.0, 2.0])
    assert robots["crowd"]["place"] == {"how": "box", "at": [0.0, 0.0]}
    sensors = {"positioning": {}, "proximity": {"noise": 0.1}}
    assert robots["fb"]["body_overrides"] == {"sensors": sensors}
    radio = {"preset": "argos-rab", "range_m": 4.0, "max_payload_bytes": 22, "loss": 0.25}
    radio |= {"line_of_sight": False, "bodies_block": False, "measures": {"range": {"noise_m": 0.1}, "bearing": {}}}
    assert scenario["radio"] == radio


def test_argos_elements_without_a_counterpart_are_named(tmp_path):
    _, agents, notes = converted(tmp_path)
    named = [note.partition(": ")[0] for note in notes]
    elements = "<footbot_gripper>", "<footbot_turret_encoder>", '<prism id="odd">', "gaussian position", "rab_range"
    for element in elements:
        assert any(name.startswith(element) for name in named), element
    assert "footbot_gripper" not in agents
    assert 'needs = ("proximity", "radio.range", "radio.bearing", "positioning", "compass")' in agents


def test_unusable_argos_experiment_is_refused(tmp_path):
    path = tmp_path / "mine.argos"
    with refused_input(tmp_path / "none.argos"):
        convert_argos(tmp_path / "none.argos", "none.py")
    for old, new in (
        ("<argos-configuration>", "<argos-configuration"),
        ("argos-configuration>", "sdf>"),
        ('ticks_per_second="20" ', ""),
        ('radius="0.15"', 'radius="wide"'),
        ('config="rule"', 'config="other"'),
        ('method="grid"', 'method="spiral"'),
        ("framework", "frame"),
    ):
        with refused_input(path):
            converted(tmp_path, EXPERIMENT.replace(old, new))


@pytest.mark.parametrize("tag", ["none_controller", "_1_controller", "___", "agent_controller", "robot"])
def test_argos_controller_with_an_odd_name_becomes_a_class(tmp_path, tag):
    _, agents, _ = converted(tmp_path, EXPERIMENT.replace("my_rule_controller", tag))
    classes = [node for node in ast.parse(agents).body if isinstance(node, ast.ClassDef)]
    assert len({node.name for node in classes} - {"Agent", "Robot"}) == len(classes)


@pytest.mark.parametrize("experiment", EXAMPLES, ids=lambda path: path.stem)
def test_argos_example_is_imported_and_runs(tmp_path, experiment):
    result = CliRunner().invoke(app, ["import", str(experiment), "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    scenario = next(tmp_path.glob("*.toml"))
    rate_hz, groups = read_toml(scenario)["time"]["rate_hz"], read_toml(scenario)["robots"]
    facts = run(scenario, overrides=[f"duration_s={3 / rate_hz}"]).summary()
    assert facts["robots"] == sum(group["count"] for group in groups.values())
    again = CliRunner().invoke(app, ["import", str(experiment), "--out", str(tmp_path)])
    assert again.exit_code != 0  # nothing is overwritten
