"""Every command on every page runs as it stands there, one after the other, and prints what the page shows.

Of a command that cannot run here the words are checked.
"""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.core import TyperGroup

from swarmwire.agent.cli import _parser as agent_parser
from swarmwire.deploy import run
from swarmwire.deploy.campaigns import sweep
from swarmwire.deploy.campaigns.tuning import run as tuning
from swarmwire.deploy.cli.app import load_command
from tests.docs.pages import PAGES, ROOT, Command, blocks_of, commands_of, environment, files_of, first_not_printed
from tests.support.deploy.campaign import InThisProcess
from tests.support.deploy.runs import called

WITH_COMMANDS = [page for page in PAGES if commands_of(page)]
SHOWN = ("docs/getting-started.md", "docs/scenario.md", "docs/api/deploy.md")
IN_THIS_PROCESS = re.compile(r"swarmwire [^|&;>*]*")
BY_ROOT = "$(command -v swarmwire)"  # behind sudo
OURS = re.compile(r"\b(swarmwire(?:-agent)?) +(?=[a-z])(.*?)(?= && |$)")


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, which holds what a user of the project finds there."""
    for folder in ("scenarios", "examples"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setenv("PATH", environment()["PATH"])
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.chdir(tmp_path)
    for campaigns in (sweep, tuning):  # each worker would load all libraries; test_smoke.py has real ones
        monkeypatch.setattr(campaigns, "open_executor", lambda *_: InThisProcess())
    return tmp_path


def in_a_shell(line: str) -> tuple[object, str]:
    """Exit code of a line and what it prints."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    done = subprocess.run(["sh", "-c", line], **pipes, check=False, timeout=300)
    return done.returncode, done.stdout


@pytest.mark.timeout(400)
@pytest.mark.parametrize("page", WITH_COMMANDS)
def test_commands_run_and_print_what_is_shown(page, project, monkeypatch, capsys):
    for name, text in files_of(page).items():
        (project / name).write_text(text)
    for command in commands_of(page):
        if IN_THIS_PROCESS.fullmatch(command.line):
            words = shlex.split(command.line)[1:]
            code, *printed = called(monkeypatch, capsys, *words)
        else:
            code, *printed = in_a_shell(command.line)
        text = "".join(printed)
        assert code == 0, f"{command.line}\n{text}"
        missing = first_not_printed(command, text)
        assert missing is None, f"{command.line}\nshown, but not printed: {missing}\n{text}"


def commands_not_run() -> list[tuple[str, str, str]]:
    """The commands of ours in blocks that nothing runs: page, program and its arguments."""
    blocks = [(page, block.text) for page in PAGES for kind in ("text", "sh") for block in blocks_of(page, kind)]
    joined = [(page, text.replace("\\\n", " ").replace(BY_ROOT, "swarmwire")) for page, text in blocks]
    lines = [(page, line.partition(" # ")[0]) for page, text in joined for line in text.splitlines()]
    return [(page, match[1], match[2]) for page, line in lines if (match := OURS.search(line))]


@pytest.mark.parametrize(("page", "program", "arguments"), commands_not_run())
def test_command_that_nothing_runs_exists_with_its_options(page, program, arguments):
    words = shlex.split(arguments)
    if program == "swarmwire-agent":  # xargs adds the file
        agent_parser().parse_args([*words, "robot.toml"] if words[-1] == "--config" else words)
        return
    name, *words = words
    command = load_command(name)
    while isinstance(command, TyperGroup):
        context = command.make_context(name, list(words))
        name, words = words[len(words) - len(context.args) - 1], context.args  # behind the options of the group
        command = command.commands[name]
    command.make_context(name, list(words))


def test_pages_with_commands_include_those_checked_for_output():
    assert set(SHOWN) <= set(WITH_COMMANDS)


def test_output_shown_on_a_page_must_be_printed_in_its_order():
    printed = "order   final 0.98,  mean 0.5\nwritten: a\n"
    assert first_not_printed(Command("", ("order final …, mean …", "written: a")), printed) is None
    assert first_not_printed(Command("", ("written: a", "order …")), printed) == "order …"
    assert first_not_printed(Command("", ("final …",)), printed) == "final …"


def test_readme_agent_runs_in_a_scenario_that_names_it(tmp_path):
    (tmp_path / "shy.py").write_text(blocks_of("README.md", "python")[0].text)
    shipped = 'agent = "swarmwire.agent.behaviours:Flocking"\nparams = { separation_m = 0.8 }\n'
    before, after = (ROOT / "scenarios" / "flocking-lossy.toml").read_text().split(shipped)
    [named] = re.findall(r'`(agent = "shy.py:Shy")`', (ROOT / "README.md").read_text())
    (tmp_path / "mine.toml").write_text(f"{before}{named}\n{after}")
    result = run(tmp_path / "mine.toml", overrides=["duration_s=1"], runners=2)
    assert result.radio.fates["received"] > 0


def test_readme_python_code_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    exec(blocks_of("README.md", "python")[1].text.replace("duration_s=20", "duration_s=1"), {})
    assert "0." in capsys.readouterr().out
