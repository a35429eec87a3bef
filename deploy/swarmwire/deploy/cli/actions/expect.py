"""`swarmwire expect`: whether a run or a campaign meets expectations, for people and for continuous integration."""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import typer
from rich.text import Text

from swarmwire.comms.base.atomic import check_output_path, output_file
from swarmwire.deploy.cli.options import FAILED
from swarmwire.deploy.terminal.console import TerminalConsole, print_rows
from swarmwire.deploy.terminal.output import echo
from swarmwire.metrics.records.campaign.expectations import Verdict, parse_expectation, verdicts

COLUMNS = ("result", "expected", "at", "measured")


def check_expectations(folder: str, expectations: Sequence[str], junit: Path | None) -> None:
    """Print a line for each expectation and design point; exit code 1 if one is not met."""
    if junit is not None:
        check_output_path(junit, (".xml",))
    checked = verdicts(folder, [parse_expectation(text) for text in expectations])
    rows = [("met" if each.is_met else "NOT MET", each.expectation.text, each.at, each.measured) for each in checked]
    console = TerminalConsole()
    print_rows(COLUMNS, rows, console)
    if junit is not None:
        write_junit(folder, checked, junit)
        echo(f"written: {junit}")
    missed = sum(not each.is_met for each in checked)
    if missed:
        console.print(Text(f"{missed} of {len(checked)} not met", "red"))
        raise typer.Exit(FAILED)


def write_junit(folder: str, checked: Sequence[Verdict], file: Path) -> None:
    """Write a JUnit XML file, which most services show: a test case for each expectation and design point."""
    failures = str(sum(not each.is_met for each in checked))
    suite = ET.Element("testsuite", name=folder, tests=str(len(checked)), failures=failures)
    for each in checked:
        case = ET.SubElement(suite, "testcase", classname="swarmwire.expect", name=each.title)
        if not each.is_met:
            ET.SubElement(case, "failure", message=f"measured {each.measured}")
    with output_file(file) as temporary:
        ET.ElementTree(suite).write(temporary, encoding="utf-8", xml_declaration=True)
