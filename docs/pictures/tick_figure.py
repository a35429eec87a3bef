"""Draws docs/tick-steps.svg: the steps of a tick and what goes from one to the other, as the loop's source has them."""

from pathlib import Path

from docs.pictures.svg import arrow, box, line, page, text
from docs.pictures.tick_steps import LANES, Step, tick_steps

TO = Path(__file__).parents[1] / "tick-steps.svg"
LANE, ROW, TOP, WIDE = 170.0, 44.0, 44.0, 124.0
FILLS = dict(zip(LANES, ("#fee2e2", "#fae8ff", "#dbeafe", "#f1f5f9", "#dcfce7", "#fef3c7"), strict=True))


def draw(to: Path = TO) -> None:
    """Write the figure."""
    steps = tick_steps()
    height = TOP + ROW * len(steps) + 12
    shapes = [text(_middle(lane), 24, lane, 15, anchor="middle", bold=True) for lane in LANES]
    shapes += [line(_middle(lane), 32, _middle(lane), height - 6) for lane in LANES]
    for i, step in enumerate(steps):
        shapes += _step(step, TOP + ROW * i)
    to.write_text(page("The steps of a tick", LANE * len(LANES), height, shapes), encoding="utf-8")


def _step(step: Step, y: float) -> list[str]:
    middle = _middle(step.lane)
    shapes = [box(middle - WIDE / 2, y, WIDE, 30, FILLS[step.lane])]
    shapes.append(text(middle, y + 19, step.method, 11, anchor="middle"))
    for i, (giver, names) in enumerate(_by_giver(step).items()):
        down, away = y + 10 + 12 * i, 1 if _middle(giver) > middle else -1
        shapes += [arrow(_middle(giver), down, middle + away * WIDE / 2, down)]
        shapes.append(text(_middle(giver) - away * 4, down - 2, names, 10, anchor="end" if away > 0 else "start"))
    return shapes


def _by_giver(step: Step) -> dict[str, str]:
    """What a step takes, a text for each lane that gave it."""
    inputs: dict[str, list[str]] = {}
    for name, giver in step.takes:
        inputs.setdefault(giver, []).append(name)
    return {giver: ", ".join(names) for giver, names in inputs.items()}


def _middle(lane: str) -> float:
    return LANE * (LANES.index(lane) + 0.5)


if __name__ == "__main__":
    draw()
