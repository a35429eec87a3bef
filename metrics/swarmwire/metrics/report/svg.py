"""Figures as text for a page or a file: equal figures are equal texts, and no two share a name within."""

import io
import re
from typing import Any, cast

from swarmwire.metrics.drawing.canvas import new_figure
from swarmwire.metrics.drawing.looks import LONG_SIDE_IN

COLUMN_IN = 3.4  # width of a figure that stands beside another, and in a paper's column

_DPI_SIZE_PX = 1280  # only what is drawn as pixels within a figure depends on it
_HEAD = re.compile(r"^.*?(?=<svg\b)", re.DOTALL)
_METADATA = re.compile(r"\s*<metadata>.*?</metadata>", re.DOTALL)
_STYLE = re.compile(r"\s*<defs>\s*<style[^>]*>[^<]*</style>\s*</defs>", re.DOTALL)
_NAMED = re.compile(r'\sid="([^"]*)"')
_DRAWN = re.compile(r'(?<= )(?:d|x|y)="[^"]*"')
_SPACE = re.compile(r"\n\s*|\s*<!--.*?-->")
_LONG = re.compile(r"(\d\.\d\d)\d+")
_USED = re.compile(r'(?:xlink:href="#|url\(#)([^")]*)')


def blank_figure(width_in: float, height_in: float) -> Any:
    """An empty matplotlib figure for `as_svg`; BadInput without matplotlib."""
    return new_figure(width_in, height_in, round(_DPI_SIZE_PX * max(width_in, height_in, LONG_SIDE_IN) / LONG_SIDE_IN))


def as_svg(figure: Any, name: str) -> str:
    """The figure as one <svg> element, whose ids begin with its name (letters, digits, `-`, `_`, `.`).

    Letters are drawn as paths, so that it looks the same in any browser, text processor and print.
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


def _with_own_ids(text: str, name: str) -> str:
    """Ids that something refers to begin with the name, the others are gone."""
    used = set(_USED.findall(text))
    kept = _NAMED.sub(lambda found: f' id="{name}-{found[1]}"' if found[1] in used else "", text)
    return _USED.sub(lambda found: found[0].replace(f"#{found[1]}", f"#{name}-{found[1]}"), kept)
