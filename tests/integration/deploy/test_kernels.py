"""Compiled functions, made on one machine and taken by another, as their caches stand for machines."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from swarmwire.comms.base import kernel_archive
from swarmwire.deploy.cli.actions.new import new_swarm
from tests.support.deploy.runs import refused_command


def test_kernels_export_without_any_says_what_to_do_first(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(kernel_archive, "sources", dict)
    export = ("kernels", "export", tmp_path / "kernels.zip")
    refused_command(monkeypatch, capsys, *export, match=".*swarmwire kernels build")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow  # a minute of compiling
@pytest.mark.timeout(1200)
def test_kernels_of_another_machine_leave_nothing_to_compile(tmp_path):
    def swarmwire(machine: str, *words: str | Path) -> str:
        command = [sys.executable, "-m", "swarmwire.deploy", *map(str, words)]
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / machine)}
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, env=environment)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout + done.stderr

    new_swarm(tmp_path / "swarm")
    swarmwire("first", "kernels", "build", "swarm")
    swarmwire("first", "kernels", "export", "kernels.zip")
    swarmwire("second", "kernels", "import", "kernels.zip")
    kernels = set((tmp_path / "second").rglob("*.nbc"))
    printed = swarmwire("second", "run", "swarm", "--set", "duration_s=2", "--out", "run")
    assert "written: run" in printed
    assert set((tmp_path / "second").rglob("*.nbc")) == kernels
