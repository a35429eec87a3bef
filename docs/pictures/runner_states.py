"""Draws docs/runner-states.svg from the table of state transitions in `world.backends.allocation`."""

from pathlib import Path

from docs.pictures.svg import arc, arrow, box, page, text
from swarmwire.world.backends.allocation import MOVES, Move, State

TO = Path(__file__).parents[1] / "runner-states.svg"
PLACES: dict[State, tuple[float, float]] = {
    "free": (70.0, 150.0),
    "joined": (240.0, 150.0),
    "ready": (410.0, 150.0),
    "waiting": (600.0, 150.0),
    "dead": (410.0, 280.0),
}
HALF_WIDTH, HALF_HEIGHT = 46.0, 20.0  # of a state's box
RISE = 0.2  # of an arrow back, for its length


def draw(to: Path = TO) -> None:
    """Write the figure: every state of the table once, every move from it an arrow."""
    shapes = [shape for state, moves in MOVES.items() for move in moves for shape in _arrow(state, move)]
    for state in MOVES:
        x, y = PLACES[state]
        shapes.append(box(x - HALF_WIDTH, y - HALF_HEIGHT, 2 * HALF_WIDTH, 2 * HALF_HEIGHT, "#dbeafe"))
        shapes.append(text(x, y + 5, state, 14, anchor="middle", bold=True))
    to.write_text(page("The states of the robots that one runner plays", 680, 320, shapes), encoding="utf-8")


def _arrow(state: State, move: Move) -> list[str]:
    (x, y), (to_x, to_y) = PLACES[state], PLACES[MOVES[state][move]]
    top, middle_x = y - HALF_HEIGHT, 0.5 * (x + to_x)
    if to_y > y:  # down, to the nearer part of the box
        end_x, end_y = to_x + 0.2 * (x - to_x), to_y - HALF_HEIGHT
        label = text(0.5 * (x + end_x) + (24 if x > to_x else 9), 0.5 * (y + to_y) + 4, move)
        return [arrow(x, y + HALF_HEIGHT, end_x, end_y), label]
    if to_x > x:
        return [arrow(x + HALF_WIDTH, y, to_x - HALF_WIDTH, y), text(middle_x, y - 6, move, anchor="middle")]
    rise = RISE * (x - to_x)
    curve = arc(x - 0.3 * HALF_WIDTH, top, to_x + 0.3 * HALF_WIDTH, rise)
    return [curve, text(middle_x, top - rise + 15, move, anchor="middle")]


if __name__ == "__main__":
    draw()
