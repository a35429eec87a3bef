"""The tables of docs/reliability.md, between two marks."""

from tests.tools.reliability.fault_table import ROOT, Fault, Process, processes

PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- faults -->\n", "<!-- end of faults -->\n"
HEAD = ("| fault | what you see | what is kept | how it goes on |", "| --- | --- | --- | --- |")


def written() -> str:
    """The page with its tables made anew."""
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    assert end, f"{PAGE} has no {BEGIN!r} with {END!r} behind it"
    return before + BEGIN + "\n" + "".join(map(_section, processes())) + END + after


def _section(process: Process) -> str:
    rows = [f"| {' | '.join(map(_cell, (row.fault, row.sees, row.kept, row.goes_on)))} |" for row in process.faults]
    tests = [f"- {row.fault}: {', '.join(f'`{test}`' for test in _tests(row))}" for row in process.faults]
    return "\n".join([f"### {process.title}", *HEAD, *rows, "", "Tests:", *tests, "", ""])


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _tests(fault: Fault) -> list[str]:
    return list(dict.fromkeys(proof.test for proof in fault.proof))
