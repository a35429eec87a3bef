"""The steps of the workflow on the page about continuous integration run as they stand there.

A hosted runner is needed for `uses:`, the actions of the service, alone.
"""

import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml

from tests.docs.pages import ROOT, blocks_of, environment

[WORKFLOW] = blocks_of("docs/ci.md", "yaml")
[JOB] = yaml.safe_load(WORKFLOW.text)["jobs"].values()
STEPS: list[dict[str, Any]] = JOB["steps"]
INSTALL = "Install"


def ran(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A step as the service runs it, with the environment of the tests in place of the installed one."""
    command, pipes = ["bash", "-e", "-o", "pipefail", "-c", line], {"capture_output": True, "text": True}
    return subprocess.run(command, cwd=folder, env=environment(), timeout=280, check=False, **pipes)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_workflow_steps_check_a_new_swarm_and_refuse_one_that_does_not_align(tmp_path):
    assert ran("swarmwire new my_swarm", tmp_path).returncode == 0
    named = {step["name"]: step["run"] for step in STEPS if "run" in step}
    for name, line in named.items():
        if name != INSTALL:
            done = ran(line, tmp_path)
            assert done.returncode == 0, f"{name}\n{done.stdout}{done.stderr}"
    suite = ET.parse(tmp_path / "expect.xml").getroot()
    assert (suite.attrib["tests"], suite.attrib["failures"]) == ("1", "0")
    assert (tmp_path / "campaign" / "report.html").is_file()
    refused = ran(named["Check the campaign"].replace("order.final >=", "order.final <"), tmp_path)
    assert refused.returncode == 1


def test_workflow_installs_by_a_command_of_the_makefile_and_caches_its_folders():
    [install] = [step["run"] for step in STEPS if step.get("name") == INSTALL]
    assert "\ninstall:" in (ROOT / "Makefile").read_text()
    assert "make -C ~/swarmwire install" in install
    [cached] = [step["with"]["path"].split() for step in STEPS if step.get("uses", "").startswith("actions/cache@")]
    assert "~/swarmwire" in cached
