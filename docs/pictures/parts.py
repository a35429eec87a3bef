"""Draws docs/parts.svg: the five parts, their folders, and which part may import which."""

from pathlib import Path
from textwrap import wrap

from docs.pictures.svg import arrow, box, page, text

ROOT = Path(__file__).parents[2]
TO = ROOT / "docs" / "parts.svg"
WIDTH, GAP = 880.0, 56.0  # between one row of parts and the next
PLACES = {  # x, y, width, height
    "deploy": (10.0, 10.0, 860.0, 86.0),
    "world": (10.0, 152.0, 280.0, 118.0),
    "metrics": (300.0, 152.0, 280.0, 118.0),
    "agent": (590.0, 152.0, 280.0, 118.0),
    "comms": (10.0, 326.0, 860.0, 89.0),
}
FILLS = {"deploy": "#f1f5f9", "world": "#dbeafe", "metrics": "#fef3c7", "agent": "#dcfce7", "comms": "#fae8ff"}


def draw(to: Path = TO) -> None:
    """Write the figure."""
    shapes: list[str] = []
    for part in PLACES:
        shapes += _part(part)
    for part in ("world", "metrics", "agent"):  # an arrow from deploy, and one to comms
        for giver in (part, "comms"):
            shapes.append(_import(PLACES[part][0] + 140, PLACES[giver][1] - GAP))
    down = PLACES["comms"][1] + PLACES["comms"][3]
    note = "An arrow is an import that is allowed. deploy may import comms, too."
    shapes.append(text(WIDTH / 2, down + 24, note, anchor="middle"))
    to.write_text(page("The parts and who imports whom", WIDTH, down + 38, shapes), encoding="utf-8")


def _part(part: str) -> list[str]:
    x, y, width, height = PLACES[part]
    code = ROOT / part / "swarmwire" / part
    folders = sorted(path.parent.name for path in code.glob("*/__init__.py"))
    files = sorted(path.stem for path in code.glob("*.py") if not path.stem.startswith("_"))
    said = wrap(" · ".join([f"{folder}/" for folder in folders] + files), int(width / 6.1))
    most = int((height - 29) / 15)
    if len(said) > most:
        said = [*said[: most - 1], f"{said[most - 1]} …"]
    lines = [text(x + 10, y + 40 + 15 * i, row, 11) for i, row in enumerate(said)]
    return [box(x, y, width, height, FILLS[part]), text(x + 10, y + 21, f"{part}/", 15, bold=True), *lines]


def _import(x: float, y: float) -> str:
    return arrow(x, y + 2, x, y + GAP - 2)


if __name__ == "__main__":
    draw()
