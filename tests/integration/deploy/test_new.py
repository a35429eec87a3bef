"""A new swarm checks, runs and passes its own test as it is made, and fails it when its agent does nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.new_swarm import new_swarm
from tests.support.deploy.commands import called


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    return new_swarm("my_swarm", tmp_path_factory.mktemp("new"))[0].parent


def python(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=cwd, check=False, env=environment)


def own_tests(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return python("pytest", "-q", "-p", "no:cacheprovider", *arguments, cwd=folder)


def test_the_command_makes_the_folder_and_says_what_to_do_next(tmp_path, monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "new", "my_swarm", "--in", tmp_path)
    assert (code, errors) == (0, "")
    names = {path.name for path in (tmp_path / "my_swarm").iterdir()}
    assert names == {"agent.py", "scenario.toml", "test_my_swarm.py", "README.md"}
    assert f"swarmwire run {tmp_path}/my_swarm/scenario.toml" in out


def test_its_files_know_its_name_and_nothing_is_left_to_fill_in(made):
    for path in made.iterdir():
        assert "$" not in path.read_text()
    assert 'name = "my_swarm"' in (made / "scenario.toml").read_text()
    assert "`test_my_swarm.py`" in (made / "README.md").read_text()


def test_it_checks_and_runs_as_it_is_made(made, tmp_path, monkeypatch, capsys):
    scenario = made / "scenario.toml"
    checked = called(monkeypatch, capsys, "check", scenario)[1]
    assert "good: 10 epuck" in checked
    assert checked.endswith("Hz, engine discs\n")
    code, out, _ = called(monkeypatch, capsys, "run", scenario, "--set", "duration_s=2", "--out", tmp_path / "out")
    assert code == 0
    assert "my_swarm" in out
    assert (tmp_path / "out" / "summary.json").is_file()


def test_its_own_test_passes_as_it_is_made(made):
    ended = own_tests(made)
    assert ended.returncode == 0, ended.stdout
    assert "3 passed" in ended.stdout


def test_its_own_test_fails_if_the_agent_neither_drives_nor_sends(tmp_path):
    folder = new_swarm("idle", tmp_path)[0].parent
    agent = folder / "agent.py"
    text = agent.read_text()
    head = text[: text.index("        heading_rad = robot")]
    agent.write_text(f"{head}        return\n")
    ended = own_tests(folder, "-k", "hear or move")
    assert ended.returncode == 1
    assert "2 failed" in ended.stdout


def test_it_follows_ruffs_default_rules(made):
    ended = python("ruff", "check", "--isolated", "--no-cache", ".", cwd=made)
    assert ended.returncode == 0, ended.stdout


@pytest.mark.parametrize("name", ["", "My", "2fast", "my-swarm", "a/b", "..", "a b", "a" * 41])
def test_a_bad_name_is_refused_and_nothing_made(tmp_path, name):
    with pytest.raises(BadInput, match="small letters"):
        new_swarm(name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_there_is_left_alone(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine").mkdir()
    code, out, errors = called(monkeypatch, capsys, "new", "mine", "--in", tmp_path)
    assert (code, out) == (2, "")
    assert errors.startswith(f"error: {tmp_path}/mine: ")
    assert not list((tmp_path / "mine").iterdir())


def test_a_place_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(BadInput) as refused:
        new_swarm("mine", tmp_path / "absent")
    assert str(tmp_path / "absent") in refused.value.where
