"""The commands report and compare, in this process."""

from io import StringIO

import pytest
from rich.console import Console
from rich.text import Text

from swarmwire.deploy.cli.actions.compare import print_comparison
from swarmwire.metrics.records.campaign.compare import compare
from swarmwire.metrics.records.campaign.folder import select
from tests.support.deploy.runs import called, refused_command
from tests.support.metrics.campaigns import write_campaign
from tests.support.metrics.recorded import wandering
from tests.support.metrics.report import run_folder
from tests.support.metrics.truths import static

pytest.importorskip("matplotlib", reason="needs the extra [report]")


@pytest.fixture
def typed(monkeypatch, capsys):
    """What calls of commands in this process begin with."""
    return monkeypatch, capsys


@pytest.fixture
def campaign(tmp_path):
    return write_campaign(tmp_path / "campaign", {"radio.loss": [0.0, 0.4]}, (1, 2, 3))


def test_report_of_no_such_response_writes_nothing(typed, campaign):
    responses = ("--response", "order", "--response", "aggregation_time_s.")
    refused_command(*typed, "report", campaign, *responses, match="--response: aggregation_time_s.: ")
    assert not (campaign / "report.html").exists()


def test_report_of_another_name_has_separate_figures(typed, campaign, tmp_path):
    code, out, _ = called(*typed, "report", campaign, "--response", "order", "--to", tmp_path / "order.html")
    assert code == 0
    assert out.splitlines()[1] == f"written: {tmp_path}/order-figures (2 figures, as SVG and PDF)"
    assert not (campaign / "report.html").exists()


def test_report_of_a_run_lies_in_its_folder(typed, tmp_path):
    run = static(3)
    (tmp_path / "run").mkdir()
    run_folder(tmp_path / "run", run, wandering(run, 12))
    code, out, _ = called(*typed, "report", tmp_path / "run")
    assert code == 0
    assert out.splitlines()[0] == f"written: {tmp_path}/run/report.html"
    refused_command(*typed, "report", tmp_path / "run", "--response", "order", match="--response: order: ")


@pytest.mark.parametrize(
    ("to", "says"),
    [("report.pdf", ".html"), ("nowhere/report.html", "report.html: "), ("taken/report.html", "figures: ")],
)
def test_report_that_cannot_be_written_is_refused_in_one_line(typed, campaign, tmp_path, to, says):
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "figures").write_text("in the way")
    refused_command(*typed, "report", campaign, "--response", "order", "--to", tmp_path / to, match=f".*{says}")


@pytest.mark.parametrize("folder", ["nothing", "empty"])
def test_report_of_neither_a_campaign_nor_a_run_is_refused(typed, tmp_path, folder):
    (tmp_path / "empty").mkdir()
    refused_command(*typed, "report", tmp_path / folder, match=f"{tmp_path / folder}: ")


@pytest.fixture
def folders(tmp_path):
    return write_campaign(tmp_path / "a"), write_campaign(tmp_path / "b", draws=1)


def test_comparison_is_printed_and_written(monkeypatch, capsys, tmp_path, folders):
    to = tmp_path / "x.csv"
    code, out, errors = called(monkeypatch, capsys, "compare", *folders, "--response", "order", "--to", to)
    assert (code, errors) == (0, "")
    heading, *lines = out.splitlines()
    assert heading.split() == ["response", "at", "A", "B", "B", "-", "A", "interval", "delta", "p", "pairs"]
    at = [f"radio.loss={loss}" for loss in ("0", "0.2", "0.4")]
    assert [line.split()[:2] for line in lines[:3]] == [["order.final", loss] for loss in at]
    assert f"written: {to}" in out
    points = (f"{folders[0]}@radio.loss={loss}" for loss in ("0", "0.4"))
    assert "A: radio.loss=0; B: radio.loss=0.4" in called(monkeypatch, capsys, "compare", *points)[1]
    assert len(to.read_text().splitlines()) == 4


@pytest.mark.parametrize("arguments", [("--response", "ordr"), ("--to", "x.txt")])
def test_compare_with_bad_arguments_prints_one_line_and_exits_with_2(typed, folders, arguments):
    code, _, errors = called(*typed, "compare", *folders, *arguments)
    assert (code, errors[:7], errors.count("\n")) == (2, "error: ", 1)


def test_comparison_table_is_no_wider_than_the_terminal(folders):
    out = StringIO()
    compared = compare(*(select(str(folder)) for folder in folders))
    print_comparison(compared, Console(file=out, force_terminal=True, width=100))
    lines = out.getvalue().splitlines()
    assert all(len(Text.from_ansi(line).plain) <= 100 for line in lines)
    assert sum("order.final" in line for line in lines) == 1  # a response is named once
