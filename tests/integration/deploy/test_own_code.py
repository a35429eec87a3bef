"""The command line with code of the user's: new projects and custom metrics."""

import os
import subprocess
import sys
from contextlib import chdir
from importlib.metadata import version
from pathlib import Path

import pytest

from swarmwire.deploy import RunFolder, Simulation, repeat, run
from swarmwire.deploy.cli.actions.new import new_swarm
from swarmwire.metrics.pictures.drawing.film import film_of
from tests.docs.pages import environment, files_of
from tests.support.custom_code import CODE, install
from tests.support.deploy.runs import called, refused_command, run_spread
from tests.support.refusals import refused_input

FROM_ZERO = "metrics.1.from_m=0.0"
SCENARIO = """
format = 1
name = "spread"
duration_s = 1.0
metrics = ["spread.py:Spread"]
[arena]
size_m = [4.0, 4.0]
[robots.a]
body = "epuck"
count = 3
agent = "swarmwire.agent.behaviours:Avoidance"
"""


def test_version_option_prints_the_version(monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "--version")
    assert (code, out, errors) == (0, f"swarmwire {version('swarmwire-deploy')}\n", "")


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    with chdir(tmp_path_factory.mktemp("new")):
        return new_swarm(Path("my_swarm"))[0].parent.absolute()


def python(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=cwd, check=False, env=environment)


def own_tests(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return python("pytest", "-q", "-p", "no:cacheprovider", *arguments, cwd=folder)


def test_new_project_has_its_name_and_no_placeholders(made):
    for path in made.iterdir():
        assert "$" not in path.read_text()
    assert 'name = "my_swarm"' in (made / "scenario.toml").read_text()
    assert "`test_my_swarm.py`" in (made / "README.md").read_text()


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_new_project_readme_commands_run_as_they_stand_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = new_swarm(Path("my_swarm"))[0].parent
    lines = [line for line in (folder / "README.md").read_text().splitlines() if line.startswith("swarmwire ")]
    assert len(lines) > 8
    for line in lines:
        pipes = {"capture_output": True, "text": True, "timeout": 200}
        done = subprocess.run(["sh", "-c", line], cwd=folder, env=environment(), check=False, **pipes)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    assert (folder / "loss" / "report.html").is_file()
    assert (folder / "film.gif").is_file()


def test_new_projects_own_test_passes_as_it_is(made):
    ended = own_tests(made)
    assert ended.returncode == 0, ended.stdout
    assert "4 passed" in ended.stdout


def test_new_projects_own_test_fails_if_the_agent_neither_drives_nor_sends(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = new_swarm(Path("idle"))[0].parent
    agent = folder / "agent.py"
    text = agent.read_text()
    head = text[: text.index("        heading_rad = robot")]
    agent.write_text(f"{head}        return\n")
    ended = own_tests(folder, "-k", "received or move")
    assert ended.returncode == 1
    assert "2 failed" in ended.stdout


def test_new_project_follows_ruffs_default_rules(made):
    ended = python("ruff", "check", "--isolated", "--no-cache", ".", cwd=made)
    assert ended.returncode == 0, ended.stdout


@pytest.mark.parametrize("name", ["", "My", "2fast", "my-swarm", "a/b-c", "..", "a b", "a" * 41])
def test_new_project_with_a_bad_name_is_refused_and_nothing_made(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    with refused_input():
        new_swarm(Path(name))
    assert not list(tmp_path.iterdir())


def test_new_project_leaves_an_existing_folder_alone(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path)
    refused_command(monkeypatch, capsys, "new", "mine", match="mine: ")
    assert not list((tmp_path / "mine").iterdir())


@pytest.fixture
def scenario(tmp_path):
    (tmp_path / "spread.py").write_text(files_of("docs/api/deploy.md")["spread.py"])
    (tmp_path / "s.toml").write_text(SCENARIO)
    return tmp_path / "s.toml"


@pytest.mark.parametrize("runners", [None, 2])
def test_custom_metric_is_in_summary_table_and_repetition(tmp_path, scenario, runners):
    result = run_spread(scenario, runners, out=tmp_path / "run")
    folder = RunFolder(tmp_path / "run")
    ticks = folder.metrics()
    assert list(folder.measured) == list(result.metrics)
    assert (folder.measured["spread"].unit, film_of(folder, 0, "").facts["spread"].kind) == ("m", "level")
    assert result.metrics["spread"].final == ticks["spread"][-1] > 0.0
    (tmp_path / "spread.py").unlink()
    again = repeat(tmp_path / "run", out=tmp_path / "again")
    assert again.same
    assert again.changes == ()
    assert RunFolder(tmp_path / "again").metrics()["spread"].equals(ticks["spread"])


def test_custom_metric_parameters_are_kept_with_the_run(tmp_path, scenario):
    (tmp_path / "spread.py").write_text(CODE)
    listed = 'metrics=["order", { metric = "spread.py:East", from_m = 1.0 }]'
    result = run(scenario, overrides=[listed, "metrics.1.from_m=2.0"], out=tmp_path / "run")
    (tmp_path / "spread.py").unlink()
    again = repeat(tmp_path / "run")
    assert again.changes == ()
    assert again.result.metrics["east"] == result.metrics["east"]
    east, two_metres_on = (run(tmp_path / "run" / "scenario.toml", overrides=over) for over in ([], [FROM_ZERO]))
    assert two_metres_on.metrics["east"].final == pytest.approx((east.metrics["east"].final or 0.0) + 2.0)


def test_custom_metric_of_a_package_is_found_by_name_and_its_code_recorded(tmp_path, scenario, monkeypatch):
    install(tmp_path / "site", "wind_metrics", {"east": "East"})
    monkeypatch.syspath_prepend(tmp_path / "site")
    result = run(scenario, overrides=['metrics=["east"]'], out=tmp_path / "run")
    assert "wind_metrics" in result.facts.modules
    assert RunFolder(tmp_path / "run").metrics()["east"][-1] == result.metrics["east"].final
    assert repeat(tmp_path / "run").changes == ()
    (tmp_path / "site" / "wind_metrics.py").write_text(CODE + "# a word more\n")
    (change,) = repeat(tmp_path / "run").changes
    assert "wind_metrics" in change


@pytest.mark.parametrize("names", [[], ["order"]])
def test_without_the_standard_ones_a_run_has_those_that_are_listed(tmp_path, scenario, names):
    settings = [f"metrics={names}", "standard_metrics=false"]
    result = run(scenario, overrides=settings, out=tmp_path / "run")
    assert list(result.metrics) == names
    assert RunFolder(tmp_path / "run").metrics().columns == ["tick", "time_s", *names, "sent", "received", "in_range"]
    assert result.record["ticks"]["rows"] == 10
    assert not [name for name in result.counts if name.startswith("observer_failed")]
    assert result.trajectory_sha256 == run(scenario).trajectory_sha256


def test_custom_metric_that_does_not_exist_is_refused_before_the_run(scenario):
    with refused_input(scenario, "metrics.0"):
        Simulation(scenario, overrides=['metrics=["spread.py:None"]'])
