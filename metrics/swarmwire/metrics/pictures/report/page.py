"""A report and its parts, and the page of HTML that holds all of it: no network, no scripts, no fonts."""

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, cast

from swarmwire.comms.base.atomic import check_output_path, make_subfolder, output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import REPORT
from swarmwire.metrics.pictures.drawing.canvas import LONG_SIDE_IN, new_figure

COLUMN_IN = 3.4  # width of a figure that stands beside another, and in a paper's column
_DPI_SIZE_PX = 1280  # resolution of the parts that are drawn as pixels
_HEAD = re.compile(r"^.*?(?=<svg\b)", re.DOTALL)
_METADATA = re.compile(r"\s*<metadata>.*?</metadata>", re.DOTALL)
_STYLE = re.compile(r"\s*<defs>\s*<style[^>]*>[^<]*</style>\s*</defs>", re.DOTALL)
_NAMED = re.compile(r'\sid="([^"]*)"')
_DRAWN = re.compile(r'(?<= )(?:d|x|y)="[^"]*"')
_SPACE = re.compile(r"\n\s*|\s*<!--.*?-->")
_LONG = re.compile(r"(\d\.\d\d)\d+")
_USED = re.compile(r'(?:xlink:href="#|url\(#)([^")]*)')
_NUMBER = re.compile(r"^\s*[-−+<>≥≤]?\s*\d|^[–-]?$")
_CODE = re.compile(r"`([^`]*)`")
PAGE = "report.html"  # in the folder that it is of
FIGURES = "figures"
_SVG_HEAD = '<?xml version="1.0" encoding="utf-8"?>\n'


@dataclass(frozen=True)
class Figure:
    """A drawing with its caption."""

    name: str  # of its file, without .svg: unique within a report
    svg: str  # a whole <svg> element, whose ids are its own
    caption: str
    pdf: bytes = b""  # the same, for LaTeX


@dataclass(frozen=True)
class ReportTable:
    """A table of texts, numbers already rounded for people."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str
    folded: bool = False  # whether the page shows only the caption until a reader opens it


@dataclass(frozen=True)
class Listing:
    """Preformatted lines: commands, error messages."""

    text: str


@dataclass(frozen=True)
class Section:
    """A heading and its content, in order."""

    title: str
    parts: tuple[str | Listing | ReportTable | Figure, ...]  # a text is a paragraph; `so` within it is code


@dataclass(frozen=True)
class Report:
    """A page."""

    title: str
    sections: tuple[Section, ...]
    about: str = ""  # a line below the title

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All figures, in order."""
        return tuple(part for section in self.sections for part in section.parts if isinstance(part, Figure))


def blank_figure(width_in: float, height_in: float) -> Any:
    """An empty matplotlib figure for `as_svg`; BadInput without matplotlib."""
    return new_figure(width_in, height_in, round(_DPI_SIZE_PX * max(width_in, height_in, LONG_SIDE_IN) / LONG_SIDE_IN))


def as_svg(figure: Any, name: str) -> str:
    """The figure as one <svg> element, whose ids begin with its name (letters, digits, `-`, `_`, `.`).

    Letters are drawn as paths, so that the figure looks the same in any browser, text processor and print.
    """
    import matplotlib as mpl

    fixed = cast("Any", mpl).rc_context
    written = io.StringIO()
    with fixed({"svg.hashsalt": "swarmwire", "svg.fonttype": "path"}):
        figure.savefig(written, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = _STYLE.sub("", _METADATA.sub("", _HEAD.sub("", written.getvalue())))
    # Its style sheet would hold for the whole page.
    text = text.replace("<svg ", '<svg stroke-linejoin="round" stroke-linecap="butt" ', 1)
    # A hundredth of a point is less than a printer shows.
    text = _DRAWN.sub(lambda found: _LONG.sub(r"\1", found[0]), text)
    return _with_own_ids(_SPACE.sub("\n", text), name).strip()


def drawn_figure(name: str, figure: Any, caption: str) -> Figure:
    """A matplotlib figure as a part of a report, as SVG and as PDF with its letters as letters."""
    import matplotlib as mpl

    written = io.BytesIO()
    with cast("Any", mpl).rc_context({"pdf.fonttype": 42}):
        figure.savefig(written, format="pdf", metadata={"CreationDate": None, "Creator": None, "Producer": None})
    return Figure(name, as_svg(figure, name), caption, written.getvalue())


def _with_own_ids(text: str, name: str) -> str:
    """Ids that something refers to begin with the name, the others are gone."""
    used = set(_USED.findall(text))
    kept = _NAMED.sub(lambda found: f' id="{name}-{found[1]}"' if found[1] in used else "", text)
    return _USED.sub(lambda found: found[0].replace(f"#{found[1]}", f"#{name}-{found[1]}"), kept)


def page(report: Report) -> str:
    """The whole page. ValueError if two figures have one name; BadInput without jinja2."""
    REPORT.need("reports")
    from jinja2 import Environment, PackageLoader, StrictUndefined

    names = [figure.name for figure in report.figures]
    if len(set(names)) < len(names):
        raise ValueError(f"figures of one name: {sorted(name for name in set(names) if names.count(name) > 1)}")
    loader = PackageLoader("swarmwire.metrics", "pictures/report")
    environment = Environment(
        loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(code=_with_code, breakable=_breakable)
    sections = [
        {"title": section.title, "anchor": f"part-{number}", "blocks": list(_blocks(section))}
        for number, section in enumerate(report.sections, 1)
    ]
    return environment.get_template("page.html.j2").render(title=report.title, about=report.about, sections=sections)


def _blocks(section: Section) -> Iterator[dict[str, Any]]:
    """The parts in the form of the template; consecutive figures are one block."""
    for kind, parts in groupby(section.parts, type):
        if kind is Figure:
            yield {"kind": "figures", "figures": [_figure(part) for part in parts if isinstance(part, Figure)]}
            continue
        for part in parts:
            if isinstance(part, ReportTable):
                yield {"kind": "table", "table": part, "numeric": _numeric_columns(part)}
            elif isinstance(part, Listing):
                yield {"kind": "listing", "text": part.text}
            else:
                yield {"kind": "text", "text": part}


def _figure(figure: Figure) -> dict[str, Any]:
    """The SVG element, with its caption as label for screen readers."""
    from markupsafe import Markup, escape

    spoken = f'<svg role="img" aria-label="{escape(figure.caption.replace("`", ""))}" '
    return {"svg": Markup(figure.svg.replace("<svg ", spoken, 1)), "caption": figure.caption}


def _numeric_columns(table: ReportTable) -> list[bool]:
    """Whether each column holds only numbers or dashes, and is aligned right."""
    return [bool(cells) and all(map(_NUMBER.match, cells)) for cells in zip(*table.rows, strict=True)] or [
        False for _ in table.columns
    ]


def _with_code(text: str) -> Any:
    """A paragraph, escaped, in which `so` is code."""
    from markupsafe import Markup, escape

    pieces = _CODE.split(text)
    return Markup("").join(
        Markup("<code>{}</code>").format(piece) if index % 2 else escape(piece) for index, piece in enumerate(pieces)
    )


def _breakable(text: str) -> Any:
    """A name, escaped, that may go on in the next line after a dot."""
    from markupsafe import Markup, escape

    return Markup(".<wbr>").join(map(escape, text.split(".")))


def write_report(report: Report, to: Path) -> list[Path]:
    """Write the page there and the figures into a folder beside it; returns all paths, the page first.

    Those of `report.html` go to `figures/`, those of `NAME.html` to `NAME-figures/`.
    BadInput for a path that cannot be written.
    """
    check_output_path(to, (".html", ".htm"))
    text = page(report)
    folder = to.parent / (FIGURES if to.name == PAGE else f"{to.stem}-{FIGURES}")
    files = {folder / f"{figure.name}.svg": f"{_SVG_HEAD}{figure.svg}\n".encode() for figure in report.figures}
    files |= {folder / f"{figure.name}.pdf": figure.pdf for figure in report.figures if figure.pdf}
    if files:
        _make(folder)
    for path, content in (files | {to: text.encode()}).items():
        with output_file(path) as aside:
            aside.write_bytes(content)
    return [to, *files]


def _make(folder: Path) -> None:
    try:
        make_subfolder(folder)
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder that can be made: {error.strerror}") from None
