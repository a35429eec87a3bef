"""The site builds without a warning, and its reference names all that the registries hold."""

import html
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from fcntl import LOCK_EX, flock
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from docs.behaviours.shown import page_of
from swarmwire import agent, deploy
from swarmwire.agent import behaviours, testing
from swarmwire.agent.parameters import parameters_of
from swarmwire.comms.base import errors
from swarmwire.comms.radio.config.impairments import Measures
from swarmwire.comms.radio.config.presets import PRESETS
from swarmwire.comms.robot.bodies.body import Body, body_names, load_body
from swarmwire.comms.robot.bodies.drives import DRIVES, Holonomic, Leds, Twist, Wheels
from swarmwire.comms.robot.bodies.ros2_names import Ros2Names
from swarmwire.comms.robot.packets import Fate
from swarmwire.comms.robot.sensors import SENSOR_SPECS, Sensors
from swarmwire.deploy import learn, run
from swarmwire.deploy.cli.app import app
from swarmwire.metrics.measures.registry import METRICS
from swarmwire.world.backends.realtime_backend import RealTimeReport
from swarmwire.world.events import ACTIONS
from swarmwire.world.scenario_file import scenario_schema
from tests.docs.pages import ROOT

pytestmark = pytest.mark.timeout(600)  # a process may wait for the builds of two others that fail


@pytest.fixture(scope="module")
def site(tmp_path_factory, testrun_uid) -> Path:
    """The built site, which pytest's processes share; the build fails with any warning."""
    folder = tmp_path_factory.getbasetemp().parent / f"site-{testrun_uid}"
    folder.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-d", folder / "doctrees"]
    command += ["-D", "toc_object_entries=0"]  # navigation of every member takes a third of the build
    with (folder / "lock").open("w") as lock:
        flock(lock, LOCK_EX)
        if not (folder / "built").exists():
            command += [ROOT / "docs", folder / "html"]
            done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=180)
            assert done.returncode == 0, done.stderr
            assert not done.stderr
            (folder / "built").touch()
    return folder / "html"


def page(site: Path, name: str) -> str:
    """The text of a page that is its own: without navigation."""
    text = (site / f"{name}.html").read_text(encoding="utf-8")
    return text[text.index("<article") : text.index("</article>")]


def code(site: Path, name: str) -> set[str]:
    """What a page names as code."""
    texts = re.findall(r"<code[^>]*>(.*?)</code>", page(site, name), re.DOTALL)
    return {html.unescape(re.sub(r"<[^>]+>", "", item)) for item in texts}


def described(site: Path, name: str) -> set[str]:
    """The Python names that a page describes."""
    return set(re.findall(r'<dt class="sig[^"]*" id="([^"]+)"', page(site, name)))


def keys_of(schema: dict[str, Any]) -> Iterator[str]:
    yield from schema["properties"]
    for definition in schema["$defs"].values():
        yield from definition.get("properties", ())


def test_scenario_and_radio_pages_name_every_key_and_choice(site):
    named = code(site, "scenario") | code(site, "radio-keys") | code(site, "ros2-radio")
    headed = {name.strip("[]").split(".")[0] for name in named if name.startswith("[")}  # [time], [robots.GROUP], …
    assert set(keys_of(scenario_schema())) <= named | headed
    assert {"time", "physics", "arena", "robots", "radio", "events", "run"} <= headed
    assert {'shape = "polygon"', '"grid"', '"walls"', '"open"'} <= named


def test_scenario_and_radio_pages_have_each_key_once(site):
    items = re.findall(r"<li>(.*?)</li>", page(site, "scenario") + page(site, "radio-keys"), re.DOTALL)
    texts = [" ".join(html.unescape(re.sub(r"<[^>]+>", "", item)).split()) for item in items]
    assert sum("Probability that a packet is lost, for each receiver" in text for text in texts) == 1
    assert sum("eligible robots; rounded half up" in text for text in texts) == 1  # the keys that choose robots
    assert "duration_s: > 0, ≤ 1e9, required. Length of the run." in texts


def test_event_kinds_have_a_section_each(site):
    text = page(site, "scenario")
    for kind in ACTIONS:
        assert re.search(rf"<h3><code[^>]*><span[^>]*>{kind.__name__.lower()}</span>", text), kind


def test_sensors_page_names_every_sensor_its_fields_and_keys(site):
    named = code(site, "sensors")
    kinds = [getattr(Sensors, name).make_readings for name in SENSOR_SPECS]
    read = {name for kind in kinds for name in (*dir(kind), *(field.name for field in fields(kind))) if name[0] != "_"}
    assert read - {"spec", "vector_sum"} <= named
    assert {*SENSOR_SPECS, *(f"radio.{field.name}" for field in fields(Measures))} <= named
    assert {f"[sensors.{name}]" for name in SENSOR_SPECS} <= named
    assert {field.name for kind in SENSOR_SPECS.values() for field in fields(kind)} <= named


def test_bodies_page_names_every_body_its_keys_and_sources(site):
    named = code(site, "bodies")
    assert {f'kind = "{name}"' for name in DRIVES} <= named
    assert {field.name for kind in (Wheels, Twist, Holonomic, Leds, Ros2Names) for field in fields(kind)} <= named
    plain = {field.name for field in fields(Body) if field.type in {"str", "float", "bool", str, float, bool}}
    assert {"like", *plain, *body_names()} <= named
    for name in body_names():
        assert html.escape(load_body(name).source, quote=False) in page(site, "bodies")
    assert "{}" not in page(site, "bodies"), "an empty table is no figure"


def test_summary_and_metrics_pages_name_every_metric_fate_and_key(site):
    named = code(site, "summary") | code(site, "metrics")
    assert {*METRICS, *(fate.name.lower() for fate in Fate)} <= named
    for fate in Fate:
        assert fate.meaning[1:] in html.unescape(page(site, "summary"))
    result = run(ROOT / "scenarios" / "flocking-lossy.toml", overrides=["duration_s=0.2"])
    summary = result.summary()
    assert {key for key in summary if key not in {"radio", "metrics"}} <= named
    assert {f"radio.{key}" for key in summary["radio"]} <= named
    assert all(field.name in page(site, "summary") for field in fields(RealTimeReport))


def test_behaviours_have_a_page_that_names_their_parameters(site):
    for name in behaviours.__all__:
        kind = getattr(behaviours, name)
        own = page_of(re.sub("(?<=[a-z])(?=[A-Z])", "_", name).lower())
        assert f'href="behaviours/{own}.html#{name.lower()}"' in page(site, "behaviours")
        named = code(site, f"behaviours/{own}")
        assert {*parameters_of(kind)} <= named


def test_radio_page_names_every_preset_with_its_source(site):
    text = html.unescape(page(site, "radio-keys"))
    assert set(PRESETS) <= code(site, "radio-keys")
    for preset in PRESETS.values():
        # Quotation marks may be typeset.
        assert all(part in text for part in preset.source.split("'"))


def commands_within(group: Any, within: str = "") -> Iterator[tuple[str, Any]]:
    """Every command by its whole name: "run", "radio fit"."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands_within(command, f"{within}{name} ")
        else:
            yield f"{within}{name}", command


def test_command_line_page_names_every_command_and_option(site):
    named = code(site, "command-line")
    group: Any = get_command(app)
    for name, command in commands_within(group):
        assert name in named
        shown = [parameter for parameter in command.params if not getattr(parameter, "hidden", False)]
        for option in (option for parameter in shown for option in parameter.opts if option.startswith("--")):
            assert any(option in item for item in named), option
    assert "runs/<scenario>-s<seed>-<UTC>" in html.unescape(page(site, "command-line"))  # no tags, no dashes
    assert "Without --realtime" in page(site, "command-line")


def test_python_pages_describe_every_public_name(site):
    types = {"f4", "f8", "i1", "i2", "i4", "u1", "u2", "u4"}  # a table of their own
    assert {f"swarmwire.agent.{name}" for name in {*agent.__all__} - types} <= described(site, "api/agent")
    assert types <= code(site, "api/agent")
    public = {f"{testing.__name__}.{name}" for name in ("Trial", "assert_equivalent", "assert_rows_independent")}
    assert public <= described(site, "api/agent")
    assert {f"swarmwire.deploy.{name}" for name in deploy.__all__} <= described(site, "api/deploy")
    assert {f"swarmwire.deploy.learn.{name}" for name in learn.__all__} <= described(site, "learn")
    ours = [kind for kind in vars(errors).values() if isinstance(kind, type)]
    assert {f"{errors.__name__}.{kind.__name__}" for kind in ours} <= described(site, "api/deploy")


def test_fields_are_described_by_the_comments_behind_them(site):
    text = html.unescape(re.sub(r"<[^>]+>", "", page(site, "api/deploy")))
    assert "number of intended receivers, of all packets" in text
    assert "start_time_s: float" in text
    assert "ndarray" not in text
