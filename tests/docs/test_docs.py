"""What the README says works as it stands there, and links lead somewhere."""

import re

import pytest

from swarmwire.deploy import run
from swarmwire.world.scenario.scenario_file import load_scenario
from tests.docs.pages import PAGES, ROOT

README = (ROOT / "README.md").read_text()


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


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    path = ROOT / page
    for target in re.findall(r"\]\(([^)#:]+)[^):]*\)", path.read_text()):
        assert (path.parent / target).exists(), target


def test_every_shipped_scenario_is_good():
    for path in sorted((ROOT / "scenarios").glob("*.toml")):
        assert load_scenario(path).source == str(path)
