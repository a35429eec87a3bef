"""What the page about several machines shows is typed on three of them, as it stands, and prints what is shown."""

import json
import re
import shlex
import shutil
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from swarmwire.deploy import run
from tests.docs.pages import ROOT, commands_of, environment
from tests.support.deploy.machines import Machine, Started, machines
from tests.support.deploy.runs import LOSSY, called

PAGE = "docs/distributed.md"
CERTIFICATES = "docs/security.md"  # whose commands make the certificates of the machines
NAMES = ("lab", "gate", "laptop")


@dataclass
class Typed:
    """A line that is typed on a machine, and what it prints before the next one is typed."""

    machine: str
    line: str
    shown: list[str] = field(default_factory=list)


def typed_in(text: str) -> list[Typed]:
    commands: list[Typed] = []
    for line in text.splitlines():
        prompt, dollar, command = line.partition("$ ")
        if dollar and prompt in NAMES:
            commands.append(Typed(prompt, command))
        else:
            commands[-1].shown.append(line)
    return commands


def shell(line: str, folder: Path) -> list[str]:
    """The command of a line, in a machine's folder, with the programs of the tests' environment."""
    return ["env", f"PATH={environment()['PATH']}", "sh", "-c", f"cd {folder} && exec {line}"]


def new_folder(folder: Path) -> Path:
    """What a machine has: the project's scenarios and programs."""
    shutil.copytree(ROOT / "scenarios", folder / "scenarios")
    return folder


@pytest.fixture
def page() -> str:
    return (ROOT / PAGE).read_text(encoding="utf-8")


def test_machines_page_commands_run_as_shown(page, tmp_path, monkeypatch, capsys):
    with machines(3) as line, ExitStack() as opened:
        on: dict[str, Machine] = dict(zip(NAMES, line, strict=True))
        with monkeypatch.context() as patched:
            certs = certificates(tmp_path, patched, capsys)
        folders = {name: new_folder(tmp_path / name) for name in NAMES}
        for name, files in table_of(page).items():
            (folders[name] / "certs").mkdir()
            for file in files:
                shutil.copy(certs / file, folders[name] / "certs")
        started: list[Started] = []
        block = re.search(r"<!-- machines -->\n```text\n(.*?)```", page, re.DOTALL)
        commands = typed_in(block[1])
        for typed in commands:
            command = on[typed.machine].command(*shell(typed.line, folders[typed.machine]))
            started.append(opened.enter_context(Started.running(command)))
            for shown in typed.shown:
                started[-1].next_line(*shown.split("…"))
        by_machine = {typed.machine: process for typed, process in zip(commands, started, strict=True)}
        assert [process.ended() for process in started if process is not by_machine["gate"]] == [0, 0, 0]
        assert by_machine["laptop"].lines[-1] == "the run is over"
        assert by_machine["gate"].stop() == 0
    summary = json.loads((folders["lab"] / "runs" / "across" / "summary.json").read_text())
    assert summary["trajectory_sha256"] == list(run(LOSSY, overrides=["duration_s=20"]).trajectory_sha256)


def certificates(folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """The CA that the commands of the page about security make, in this process: each program would take seconds."""
    shutil.copytree(ROOT / "examples" / "fleet", folder / "examples" / "fleet")
    monkeypatch.chdir(folder)
    for command in commands_of(CERTIFICATES):
        code, _, errors = called(monkeypatch, capsys, *shlex.split(command.line)[1:])
        assert code == 0, errors
    return folder / "lab-ca"


def table_of(page: str) -> dict[str, list[str]]:
    """Which files the page has on which machine."""
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("| ")]
    return {row[0].strip(): re.findall("`([^`]+)`", row[1]) for row in rows if row[0].strip() in NAMES}
