"""A report as one page of HTML that needs nothing else: no network, no scripts, no fonts."""

import re
from collections.abc import Iterator
from itertools import groupby
from typing import Any

from swarmwire.comms.extras import REPORT
from swarmwire.metrics.report.section import Figure, Listing, Report, Section, Table

_NUMBER = re.compile(r"^\s*[-−+<>≥≤]?\s*\d|^[–-]?$")
_CODE = re.compile(r"`([^`]*)`")


def page(report: Report) -> str:
    """The whole page. ValueError if two figures have one name; BadInput without jinja2."""
    REPORT.need("reports")
    from jinja2 import Environment, PackageLoader, StrictUndefined

    names = [figure.name for figure in report.figures]
    if len(set(names)) < len(names):
        raise ValueError(f"figures of one name: {sorted(name for name in set(names) if names.count(name) > 1)}")
    loader = PackageLoader("swarmwire.metrics", "report")
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
    """The parts as the template takes them; figures that follow one another stand together."""
    for kind, parts in groupby(section.parts, type):
        if kind is Figure:
            yield {"kind": "figures", "figures": [_figure(part) for part in parts if isinstance(part, Figure)]}
            continue
        for part in parts:
            if isinstance(part, Table):
                yield {"kind": "table", "table": part, "numeric": _numeric_columns(part)}
            elif isinstance(part, Listing):
                yield {"kind": "listing", "text": part.text}
            else:
                yield {"kind": "text", "text": part}


def _figure(figure: Figure) -> dict[str, Any]:
    """The element goes into the page as it is, with its caption for those who cannot see it."""
    from markupsafe import Markup, escape

    spoken = f'<svg role="img" aria-label="{escape(figure.caption.replace("`", ""))}" '
    return {"svg": Markup(figure.svg.replace("<svg ", spoken, 1)), "caption": figure.caption}


def _numeric_columns(table: Table) -> list[bool]:
    """Whether a column holds numbers (and dashes for none), which stand at the right."""
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
