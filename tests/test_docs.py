"""What the README and the docs say works as it stands there."""

import re
from pathlib import Path

import pytest

from swarmwire.comms.body import body_names, load_body
from swarmwire.comms.fates import FATE_NAMES
from swarmwire.deploy import run
from swarmwire.metrics.registry import METRICS
from swarmwire.world.scenario_file import load_scenario, scenario_schema

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
SCENARIO_PAGE = (ROOT / "docs" / "scenario.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def test_the_readmes_agent_runs_with_the_readmes_table(tmp_path):
    (tmp_path / "shy.py").write_text(blocks("python")[0])
    lossy = (ROOT / "scenarios" / "flocking-lossy.toml").read_text()
    before, after = lossy[: lossy.index("[robots.flock]")], lossy[lossy.index("[radio]") :]
    (tmp_path / "mine.toml").write_text(before + blocks("toml")[0] + "\n" + after)
    result = run(tmp_path / "mine.toml", overrides=["duration_s=1"], runners=2)
    assert result.radio is not None
    assert result.radio.fates["heard"] > 0


def test_the_readmes_python_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    exec(blocks("python")[1].replace("duration_s=20", "duration_s=1"), {})
    assert "0." in capsys.readouterr().out


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "docs/design.md", "docs/scenario.md"])
def test_links_lead_somewhere(page):
    path = ROOT / page
    for target in re.findall(r"\]\(([^)#:]+)\)", path.read_text()):
        assert (path.parent / target).exists(), target


def test_the_page_names_every_key_body_fate_and_metric():
    tables = {"time", "physics", "arena", "robots", "radio", "run"}
    schema = scenario_schema()
    named = [key for key in schema["properties"] if key not in tables]
    for definition in ("ArenaTable", "RobotsTable", "Radio", "RunTable", "PhysicsTable", "TimeTable"):
        named += schema["$defs"][definition]["properties"]
    for name in [*named, *body_names(), *FATE_NAMES, *METRICS, *(s for b in body_names() for s in load_body(b).senses)]:
        assert f"`{name}`" in SCENARIO_PAGE or f" {name}`" in SCENARIO_PAGE, name


def test_every_shipped_scenario_is_good():
    for path in sorted((ROOT / "scenarios").glob("*.toml")):
        assert load_scenario(path).source == str(path)
