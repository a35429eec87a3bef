"""Draws docs/parts.svg: the five parts, their folders, and which part may import which."""

from pathlib import Path
from textwrap import wrap

from docs.pictures.svg import arrow, box, page, text

ROOT = Path(__file__).parents[2]
TO = ROOT / "docs" / "parts.svg"
WIDTH, GAP = 880.0, 56.0  # between one row of parts and the next
BOXES = {  # x, y, width, height
    "deploy": (10.0, 10.0, 860.0, 74.0),
    "world": (10.0, 140.0, 280.0, 133.0),
    "metrics": (300.0, 140.0, 280.0, 133.0),
    "agent": (590.0, 140.0, 280.0, 133.0),
    "comms": (10.0, 329.0, 860.0, 74.0),
}
TITLES = {
    "deploy": "runs, campaigns, commands and fleets",
    "world": "physics, sensors, the loop",
    "metrics": "measures, records, reports",
    "agent": "what decides; drivers of robots",
    "comms": "the contract between world and agents, the wire, the radio",
}
FOLDERS_ONLY = ("deploy", "metrics")  # the others show their files, too
FILLS = {"deploy": "#f1f5f9", "world": "#dbeafe", "metrics": "#fef3c7", "agent": "#dcfce7", "comms": "#fae8ff"}


def draw(to: Path = TO) -> None:
    """Write the figure."""
    shapes: list[str] = []
    for part in BOXES:
        shapes += _part(part)
    for part in ("world", "metrics", "agent"):  # an arrow from deploy, and one to comms
        for imported in (part, "comms"):
            shapes.append(_import(BOXES[part][0] + 140, BOXES[imported][1] - GAP))
    down = BOXES["comms"][1] + BOXES["comms"][3]
    note = "An arrow is an import that is allowed. deploy may import comms, too."
    shapes.append(text(WIDTH / 2, down + 24, note, anchor="middle"))
    to.write_text(page("The parts and who imports whom", WIDTH, down + 38, shapes), encoding="utf-8")


def _part(part: str) -> list[str]:
    x, y, width, height = BOXES[part]
    code = ROOT / part / "swarmwire" / part
    folders = sorted(path.parent.name for path in code.glob("*/__init__.py"))
    files = sorted(path.stem for path in code.glob("*.py") if not path.stem.startswith("_"))
    names = [f"{folder}/" for folder in folders] + ([] if part in FOLDERS_ONLY else files)
    rows = wrap(" · ".join(names), int(width / 5.9))
    max_rows = int((height - 29) / 15)
    if len(rows) > max_rows:
        rows = [*rows[: max_rows - 1], f"{rows[max_rows - 1]} …"]
    lines = [text(x + 10, y + 40 + 15 * i, row, 11) for i, row in enumerate(rows)]
    title = [text(x + 10, y + 21, f"{part}/", 15, bold=True), text(x + 88, y + 21, TITLES[part], 11)]
    return [box(x, y, width, height, FILLS[part]), *title, *lines]


def _import(x: float, y: float) -> str:
    return arrow(x, y + 2, x, y + GAP - 2)


if __name__ == "__main__":
    draw()
