"""`swarmwire compare`: a table for people, a file for programs, one line for what is wrong."""

from io import StringIO

import pytest
from rich.console import Console
from rich.text import Text

from swarmwire.deploy.terminal.tables import print_comparison
from swarmwire.metrics.campaign.compare import compare
from swarmwire.metrics.campaign.folder import select
from tests.support.deploy.commands import called
from tests.support.metrics.campaign.campaigns import write_campaign


@pytest.fixture
def folders(tmp_path):
    return write_campaign(tmp_path / "a"), write_campaign(tmp_path / "b", draws=1)


def test_a_comparison_is_printed_and_written(monkeypatch, capsys, tmp_path, folders):
    to = tmp_path / "x.csv"
    code, out, errors = called(monkeypatch, capsys, "compare", *folders, "--response", "order", "--to", to)
    assert (code, errors) == (0, "")
    heading, *lines = out.splitlines()
    assert heading.split() == ["response", "at", "A", "B", "B", "-", "A", "interval", "delta", "p", "pairs"]
    assert [line.split()[:2] for line in lines[:3]] == [
        ["order.final", f"radio.loss={loss}"] for loss in ("0", "0.2", "0.4")
    ]
    assert f"written: {to}" in out
    assert len(to.read_text().splitlines()) == 4


def test_points_are_chosen_by_value(monkeypatch, capsys, folders):
    code, out, _ = called(monkeypatch, capsys, "compare", *folders, "--at", "radio.loss=0.2")
    assert code == 0
    assert "radio.loss=0.4" not in out
    code, out, _ = called(monkeypatch, capsys, "compare", f"{folders[0]}@radio.loss=0", f"{folders[0]}@radio.loss=0.4")
    assert code == 0
    assert "A: radio.loss=0; B: radio.loss=0.4" in out


@pytest.mark.parametrize(
    "arguments", [("--response", "ordr"), ("--at", "radio.loss=3"), ("--at", "radio.loss"), ("--to", "x.txt")]
)
def test_what_is_wrong_gets_one_line_and_exit_code_2(monkeypatch, capsys, folders, arguments):
    code, _, errors = called(monkeypatch, capsys, "compare", *folders, *arguments)
    assert code == 2
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1


def test_a_terminal_gets_a_table_no_wider_than_it_is(folders):
    out = StringIO()
    print_comparison(
        compare(*(select(str(folder)) for folder in folders)), Console(file=out, force_terminal=True, width=100)
    )
    lines = out.getvalue().splitlines()
    assert all(len(Text.from_ansi(line).plain) <= 100 for line in lines)
    assert sum("order.final" in line for line in lines) == 1  # a response is named once
