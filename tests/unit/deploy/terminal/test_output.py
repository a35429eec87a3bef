"""Names and messages from files and other machines cannot command the terminal."""

from dataclasses import replace
from io import StringIO

import pytest
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text
from typer import Exit

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.cli.inspect import verify_command
from swarmwire.deploy.runs.record.folder import RunWriter
from swarmwire.deploy.terminal.console import TerminalConsole
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.records.run_folder.tables import write_static
from tests.support.metrics.truths import static

EVIL = "a\x1b[2Kb\u202ec\x9b31md"  # erases the line, reverses letters, and colours them (by a C1 control)
HARMLESS = r"a\x1b[2Kb\u202ec\x9b31md"


def in_a_table(text):
    table = Table(title=text)
    table.add_column(Text(text))
    table.add_row(text)
    return table


@pytest.mark.parametrize("shown", [str, Text, Panel, in_a_table, None])
def test_escapes_in_names_are_shown_as_text_by_the_console(shown):
    """Also in a live panel, None."""
    out = StringIO()
    console = TerminalConsole(file=out, width=80, force_terminal=True, color_system=None)
    if shown:
        console.print(shown(EVIL))
        assert "\x1b" not in out.getvalue()
    else:
        with Live(Panel(EVIL), console=console):
            pass
    assert HARMLESS in out.getvalue()
    assert "\u202e" not in out.getvalue()


def test_brackets_in_names_are_no_markup_and_styles_stay():
    out = StringIO()
    console = TerminalConsole(file=out, width=80, force_terminal=True, color_system="standard", _environ={})
    console.print("[/bold] [link=file:///etc]x[/link]", Text("red", "red"))
    assert "[/bold] [link=file:///etc]x[/link]" in out.getvalue()
    assert "\x1b[31mred\x1b[0m" in out.getvalue()


def test_piped_lines_are_not_wrapped_unless_columns_are_set(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    line = "word " * 100 + "end"
    for columns, lines in ((None, 1), ("50", 11)):
        if columns:
            monkeypatch.setenv("COLUMNS", columns)
        out = StringIO()
        TerminalConsole(file=out).print(line)
        assert out.getvalue().count("\n") == lines


def test_escapes_are_shown_as_text_by_echo_and_lines_stay(capsys):
    echo(f"first {EVIL}\n\tsecond")
    echo(EVIL, err=True)
    out, err = capsys.readouterr()
    assert out == f"first {HARMLESS}\n\tsecond\n"
    assert err == f"{HARMLESS}\n"


def test_escapes_in_messages_of_a_run_reach_neither_terminal_nor_log(tmp_path, capsys):
    folder = RunWriter(tmp_path / "run", WallClock())
    folder.report(f"runner {EVIL} left")
    folder.failed_to_start(SwarmwireError, SwarmwireError("over"), None)
    assert f"runner {HARMLESS} left" in capsys.readouterr().err
    assert f"runner {HARMLESS} left" in (tmp_path / "run" / "log.txt").read_text()


def test_name_with_a_line_break_makes_no_line_of_its_own_in_verify(tmp_path, capsys):
    write_static(replace(static(3), name="flock\nintact: all\x1b[2K"), tmp_path / "static.json")
    with pytest.raises(Exit):
        verify_command(tmp_path)
    shown = capsys.readouterr().out
    assert r"flock\nintact" in shown
    assert "\x1b" not in shown
