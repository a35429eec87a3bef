"""A project made by the commands of the page about the library names swarmwire as the page shows it."""

import subprocess
import tomllib

import pytest

from tests.docs.pages import ROOT, blocks_of

UV = ROOT / ".ci" / "uv"


@pytest.fixture
def made() -> list[str]:
    """The commands that make a project and add swarmwire to it."""
    return blocks_of("docs/library.md", "text")[0].text.splitlines()


def test_library_page_commands_make_a_project_that_names_the_clone(made, tmp_path):
    (tmp_path / "swarmwire").symlink_to(ROOT)
    # Frozen: without the versions, for which the package index would be asked.
    line = " && ".join([*made[:-1], f"{made[-1]} --extra test --frozen"]).replace("uv ", f"{UV} ")
    done = subprocess.run(["sh", "-ec", line], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    project = tomllib.loads((tmp_path / "study" / "pyproject.toml").read_text())
    shown = tomllib.loads(blocks_of("docs/library.md", "toml")[0].text)
    assert project["project"]["dependencies"] == shown["dependencies"]
    assert project["tool"]["uv"]["sources"] == shown["tool"]["uv"]["sources"]


def test_library_page_wheels_are_made_by_a_command_of_the_makefile():
    assert "\nwheels:" in (ROOT / "Makefile").read_text()
    assert "--find-links ../swarmwire/wheels swarmwire" in blocks_of("docs/library.md", "text")[1].text
