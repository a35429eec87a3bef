"""A report written down: the page, and its figures as files beside it."""

from pathlib import Path

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.atomic import check_output_path, output_file
from swarmwire.metrics.report.page import page
from swarmwire.metrics.report.section import Report

PAGE = "report.html"  # in the folder that it is of
FIGURES = "figures"
_SVG_HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'


def write_report(report: Report, to: Path) -> list[Path]:
    """Write the page there and the figures into a folder beside it; the paths of all of them, the page first.

    Those of `report.html` go to `figures/`, those of `NAME.html` to `NAME-figures/`.
    BadInput for a path that cannot be.
    """
    check_output_path(to, (".html", ".htm"))
    text = page(report)
    folder = to.parent / (FIGURES if to.name == PAGE else f"{to.stem}-{FIGURES}")
    files = {folder / f"{figure.name}.svg": f"{_SVG_HEAD}{figure.svg}\n" for figure in report.figures}
    if files:
        _make(folder)
    for path, content in (files | {to: text}).items():
        with output_file(path) as aside:
            aside.write_text(content, encoding="utf-8")
    return [to, *files]


def _make(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder that can be made: {error.strerror}") from None
