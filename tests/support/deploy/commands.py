"""The command line as tests start it: a process of its own, with what it prints."""

import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from swarmwire.deploy.cli.app import main

ROOT = Path(__file__).parents[3]
LOSSY = ROOT / "scenarios" / "flocking-lossy.toml"


def swarmwire(*arguments: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """A finished call."""
    command = [sys.executable, "-m", "swarmwire.deploy", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, cwd=cwd, check=False)


def called(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *arguments: str | Path
) -> tuple[object, str, str]:
    """Exit code, output and errors of a call in this process: many times as quick as a process of its own."""
    monkeypatch.setattr(sys, "argv", ["swarmwire", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    out, errors = capsys.readouterr()
    return ended.value.code, out, errors


def started(*arguments: str | Path) -> subprocess.Popen[str]:
    """A run that has begun to tick."""
    command = [sys.executable, "-m", "swarmwire.deploy", "run", *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    first = process.stdout.readline()
    assert "robots" in first, (first, process.stderr.read() if process.stderr and not first else "")
    return process


def family(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """All processes of a run but the first."""
    return psutil.Process(process.pid).children(recursive=True)


def runners_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """The runners' processes of a run."""
    return [runner for agent_host in psutil.Process(process.pid).children() for runner in agent_host.children()]
