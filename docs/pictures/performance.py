"""Draws docs/performance.svg: speeds from the measured rows in docs/dev/performance.csv."""

import csv
from math import log10
from pathlib import Path

from docs.pictures.svg import box, line, page, text

TO = Path(__file__).parents[1] / "performance.svg"
TABLE = Path(__file__).parents[1] / "dev" / "performance.csv"
RATE_HZ = 10.0  # of agents in all benchmarks
BARS = {  # name of the row: label, robots in an arena
    "single-10-radio": ("one run of 10 robots, unit disk", 10),
    "inprocess-1000-d1": ("1,000 robots, no radio", 1000),
    "inprocess-1000-d1-radio": ("1,000 robots, unit disk", 1000),
    "radio-802154-1000": ("1,000 robots, 802.15.4: radio alone", 1000),
    "processes-100": ("100 robots, a process each", 100),
    "processes-1000": ("1,000 robots, a process each", 1000),
}
LEFT, WIDTH, ROW_HEIGHT, TOP = 250.0, 560.0, 34.0, 44.0
LEAST, MOST = 0.5, 500.0
BAR, SLOW = "#93c5fd", "#fcd34d"


def speeds(table: str) -> dict[str, float]:
    """The speed of each bar, in multiples of real time."""
    measured = {name: value.split() for name, _, value, *_ in csv.reader(table.splitlines())}
    return {
        name: float(measured[name][0].replace(",", ""))
        / (robots * RATE_HZ if measured[name][1] == "robot-steps/s" else 1.0)
        for name, (_, robots) in BARS.items()
    }


def draw(to: Path = TO) -> None:
    """Write the figure."""
    height = TOP + ROW_HEIGHT * len(BARS) + 34
    shapes = [text(LEFT, 22, "speed in multiples of real time (logarithmic)", 13, bold=True)]
    for tick in (1, 10, 100):
        shapes += [
            line(_x(tick), TOP - 8, _x(tick), height - 28),
            text(_x(tick), height - 10, f"{tick}", anchor="middle"),
        ]
    for i, (name, speed) in enumerate(speeds(TABLE.read_text(encoding="utf-8")).items()):
        y = TOP + ROW_HEIGHT * i
        shapes.append(text(LEFT - 10, y + 17, BARS[name][0], anchor="end"))
        shapes.append(box(LEFT, y, _x(speed) - LEFT, 24, BAR if speed >= 1.0 else SLOW))
        shapes.append(text(_x(speed) + 8, y + 17, f"{speed:.2g} x" if speed < 10 else f"{speed:.0f} x", bold=True))
    to.write_text(page("Speed by kind of run", LEFT + WIDTH, height, shapes), encoding="utf-8")


def _x(speed: float) -> float:
    return LEFT + (WIDTH - 60) * log10(speed / LEAST) / log10(MOST / LEAST)


if __name__ == "__main__":
    draw()
