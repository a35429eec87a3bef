"""Plain SVG, a line of text for each shape: small files that are the same on every machine."""

from html import escape

INK, FAINT = "#334155", "#94a3b8"


def box(x: float, y: float, width: float, height: float, fill: str) -> str:
    """A rectangle with round corners."""
    return f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="5" fill="{fill}" stroke="{FAINT}"/>'


def text(x: float, y: float, words: str, size: int = 12, *, anchor: str = "start", bold: bool = False) -> str:
    """One line of text; `anchor` is start, middle or end."""
    weight = ' font-weight="bold"' if bold else ""
    return f'<text x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{anchor}"{weight}>{escape(words)}</text>'


def arrow(x: float, y: float, to_x: float, to_y: float) -> str:
    """A line with a tip."""
    return f'<path d="M{x:g} {y:g} L{to_x:g} {to_y:g}" stroke="{INK}" fill="none" marker-end="url(#tip)"/>'


def arc(x: float, y: float, to_x: float, rise: float) -> str:
    """A curve with a tip between two points of one height, which it overtops by `rise`."""
    way = f"M{x:g} {y:g} Q{0.5 * (x + to_x):g} {y - 2 * rise:g} {to_x:g} {y:g}"
    return f'<path d="{way}" stroke="{INK}" fill="none" marker-end="url(#tip)"/>'


def line(x: float, y: float, to_x: float, to_y: float) -> str:
    """A faint line."""
    return f'<path d="M{x:g} {y:g} L{to_x:g} {to_y:g}" stroke="{FAINT}" stroke-dasharray="2 4" fill="none"/>'


def page(title: str, width: float, height: float, shapes: list[str]) -> str:
    """The whole file, white behind the shapes."""
    tip = (
        '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" '
        f'orient="auto"><path d="M0 0 L10 5 L0 10 z" fill="{INK}"/></marker></defs>'
    )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
        f'height="{height:g}" font-family="sans-serif" fill="#0f172a" role="img"><title>{escape(title)}</title>'
    )
    return "\n".join([head, tip, f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>', *shapes, "</svg>\n"])
