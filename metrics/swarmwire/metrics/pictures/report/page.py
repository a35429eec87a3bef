"""The parts of a report, its kinds of sections, and its HTML page, which needs no network, script or font."""

import io
import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from swarmwire.comms.base.atomic import check_output_path, make_subfolder, output_file
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import REPORT
from swarmwire.metrics.pictures.drawing.canvas import LONG_SIDE_IN, new_figure

Data = TypeVar("Data")

COLUMN_IN = 3.4  # width of a figure, equal to a column of a paper; a page shows two side by side
_DPI_SIZE_PX = 1280  # resolution of rasterized artists
_COORDINATE = re.compile(r"([1-9]\d*\.\d\d)\d+")  # numbers above 1 in pt; scales of glyphs are below 1
_NUMBER = re.compile(r"^\s*[-−+<>≥≤]?\s*\d|^[–-]?$")
_CODE = re.compile(r"`([^`]*)`")
PAGE = "report.html"
FIGURES = "figures"


@dataclass(frozen=True)
class Figure:
    """A drawing with its caption."""

    name: str  # name of its file without suffix, unique within a report
    svg: bytes  # an SVG document
    caption: str
    pdf: bytes = b""  # the same drawing for LaTeX


@dataclass(frozen=True)
class ReportTable:
    """A table of texts, numbers already rounded for people."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str
    folded: bool = False  # the page shows only the caption until a reader opens it


@dataclass(frozen=True)
class Listing:
    """Preformatted lines: commands, error messages."""

    text: str


Part = str | Listing | ReportTable | Figure  # a text is a paragraph, in which backticks mark code


@dataclass(frozen=True)
class Section:
    """A heading and its content, in order."""

    title: str
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class Report:
    """The sections of a page."""

    title: str
    sections: tuple[Section, ...]
    about: str = ""  # a line below the title

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All figures, in order."""
        return tuple(part for section in self.sections for part in section.parts if isinstance(part, Figure))


@dataclass(frozen=True)
class ReportSection(Generic[Data]):
    """A section that reports may have; a new one is such an object and an entry in `SECTIONS` of its report."""

    title: str
    parts: Callable[[Data], Sequence[Part]]  # no parts: the report omits the section
    methods: tuple[str, ...] = ()  # paragraphs on its statistics, for the section Methods


def build_sections(kinds: Iterable[ReportSection[Data]], data: Data) -> tuple[tuple[Section, ...], tuple[str, ...]]:
    """Return the sections that have parts, and their paragraphs on methods."""
    sections: list[Section] = []
    methods: list[str] = []
    for kind in kinds:
        parts = tuple(kind.parts(data))
        if parts:
            sections.append(Section(kind.title, parts))
            methods += kind.methods
    return tuple(sections), tuple(methods)


def blank_figure(width_in: float, height_in: float) -> Any:
    """Return an empty matplotlib figure of this size; BadInput without matplotlib."""
    return new_figure(width_in, height_in, round(_DPI_SIZE_PX * max(width_in, height_in, LONG_SIDE_IN) / LONG_SIDE_IN))


def svg_of(figure: Any) -> bytes:
    """Return a matplotlib figure as an SVG document; equal figures give equal bytes.

    Letters are paths, so the figure looks the same in any browser, text processor and print.
    """
    text = _saved(
        figure, "svg", {"svg.hashsalt": "swarmwire", "svg.fonttype": "path"}, ("Date", "Creator", "Format", "Type")
    )
    # A hundredth of a point is below the resolution of a printer; six decimals would double the size.
    return _COORDINATE.sub(r"\1", text.decode()).encode()


def drawn_figure(name: str, figure: Any, caption: str) -> Figure:
    """Return a matplotlib figure as a part of a report: as SVG, and as PDF with embedded fonts."""
    pdf = _saved(figure, "pdf", {"pdf.fonttype": 42}, ("CreationDate", "Creator", "Producer"))
    return Figure(name, svg_of(figure), caption, pdf)


def _saved(figure: Any, file_format: str, settings: dict[str, Any], omitted: tuple[str, ...]) -> bytes:
    """Return the figure's file, without the omitted metadata, which would differ from run to run."""
    import matplotlib as mpl

    file = io.BytesIO()
    with cast("Any", mpl).rc_context(settings):
        figure.savefig(file, format=file_format, metadata=dict.fromkeys(omitted))
    return file.getvalue()


def page(report: Report) -> str:
    """Return the HTML of a report. ValueError if two figures have the same name; BadInput without jinja2."""
    REPORT.need("reports")
    from jinja2 import Environment, PackageLoader, StrictUndefined

    names = [figure.name for figure in report.figures]
    if len(set(names)) < len(names):
        raise ValueError(f"figures of the same name: {sorted(name for name in set(names) if names.count(name) > 1)}")
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
    """Yield the parts in the form of the template; consecutive figures form a block."""
    for kind, parts in groupby(section.parts, type):
        if kind is Figure:
            yield {"kind": "figures", "figures": [_image(part) for part in parts if isinstance(part, Figure)]}
            continue
        for part in parts:
            if isinstance(part, ReportTable):
                yield {"kind": "table", "table": part, "numeric": _numeric_columns(part)}
            elif isinstance(part, Listing):
                yield {"kind": "listing", "text": part.text}
            else:
                yield {"kind": "text", "text": part}


def _image(figure: Figure) -> dict[str, str]:
    """Return the figure as a data URI, so that its ids and styles hold within it alone; the caption is its alt text."""
    return {
        "source": f"data:image/svg+xml;base64,{b64encode(figure.svg).decode()}",
        "alt": figure.caption.replace("`", ""),
        "caption": figure.caption,
    }


def _numeric_columns(table: ReportTable) -> list[bool]:
    """Return one flag per column: True if it holds only numbers or dashes, and is aligned right."""
    return [bool(cells) and all(map(_NUMBER.match, cells)) for cells in zip(*table.rows, strict=True)] or [
        False for _ in table.columns
    ]


def _with_code(text: str) -> Any:
    """Return an escaped paragraph in which texts between backticks are code."""
    from markupsafe import Markup, escape

    pieces = _CODE.split(text)
    return Markup("").join(
        Markup("<code>{}</code>").format(piece) if index % 2 else escape(piece) for index, piece in enumerate(pieces)
    )


def _breakable(text: str) -> Any:
    """Return an escaped name that may break after each dot."""
    from markupsafe import Markup, escape

    return Markup(".<wbr>").join(map(escape, text.split(".")))


def write_report(report: Report, to: Path) -> list[Path]:
    """Write the page and, into a folder next to it, its figures; return all paths, the page first.

    The folder is `figures/` for `report.html`, and `NAME-figures/` for `NAME.html`. BadInput for a path that cannot be
    written.
    """
    check_output_path(to, (".html", ".htm"))
    text = page(report)
    folder = to.parent / (FIGURES if to.name == PAGE else f"{to.stem}-{FIGURES}")
    files = {folder / f"{figure.name}.svg": figure.svg for figure in report.figures}
    files |= {folder / f"{figure.name}.pdf": figure.pdf for figure in report.figures if figure.pdf}
    if files:
        _make_folder(folder)
    for path, content in (files | {to: text.encode()}).items():
        with output_file(path) as part:
            part.write_bytes(content)
    return [to, *files]


def _make_folder(folder: Path) -> None:
    try:
        make_subfolder(folder)
    except OSError as error:
        raise BadInput(str(folder), "", f"expected a folder that can be created: {error.strerror}") from None
