"""Every command on every page runs as it stands there, one after the other, and prints what the page shows."""

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from swarmwire.comms.bodies.body import body_from
from tests.docs.pages import PAGES, ROOT, Command, blocks_of, commands_of, files_of, first_not_printed

WITH_COMMANDS = [page for page in PAGES if commands_of(page)]
SHOWN = ("docs/getting-started.md", "docs/scenario.md", "docs/api/deploy.md")
UV = """#!/bin/sh
# What `uv run` comes to here: the environment is that of the tests.
test "$1" = run || exit 64
shift
exec "$@"
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A folder that holds what a user of the project finds there."""
    for folder in ("scenarios", "examples"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "uv").write_text(UV)
    (tmp_path / "bin" / "uv").chmod(0o755)
    return tmp_path


def typed(command: Command, project: Path) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join([str(project / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": path, "COLUMNS": "120"}
    return subprocess.run(
        ["sh", "-c", command.line],
        cwd=project,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=100,
    )


@pytest.mark.timeout(400)
@pytest.mark.parametrize("page", WITH_COMMANDS)
def test_commands_run_and_print_what_is_shown(page, project):
    for name, text in files_of(page).items():
        (project / name).write_text(text)
    for command in commands_of(page):
        done = typed(command, project)
        assert done.returncode == 0, f"{command.line}\n{done.stdout}"
        missing = first_not_printed(command, done.stdout)
        assert missing is None, f"{command.line}\nshown, but not printed: {missing}\n{done.stdout}"


def test_the_pages_that_show_commands_are_found():
    assert set(SHOWN) <= set(WITH_COMMANDS)


def test_what_is_shown_must_be_printed_in_its_order():
    printed = "order   final 0.98,  mean 0.5\nwritten: a\n"
    assert first_not_printed(Command("", ("order final …, mean …", "written: a")), printed) is None
    assert first_not_printed(Command("", ("written: a", "order …")), printed) == "order …"
    assert first_not_printed(Command("", ("final …",)), printed) == "final …"


@pytest.mark.parametrize("page", [page for page in PAGES if page.startswith("docs")])
def test_code_is_in_a_file_that_the_page_names_and_uses(page):
    files = files_of(page)
    assert all(block.file for block in blocks_of(page, "python"))
    for name in files:
        users = [command.line for command in commands_of(page)] + [files[other] for other in files if other != name]
        assert any(name in user for user in users), name
        assert f"`{name}`" in (ROOT / page).read_text(), name


def test_the_sheets_on_the_page_about_bodies_are_bodies():
    sheets = [tomllib.loads(block.text) for block in blocks_of("docs/bodies.md", "toml")]
    assert {"like" in sheet for sheet in sheets} == {True, False}
    for sheet in sheets:
        assert body_from(sheet, "docs/bodies.md").name == sheet["name"]


@pytest.mark.parametrize("page", PAGES)
def test_parts_of_scenarios_are_toml(page):
    for block in blocks_of(page, "toml"):
        tomllib.loads(block.text)
