"""Draws the states of a runner from the tables of moves of both sides of the protocol.

docs/runner-states.svg is the world's side, of `world.backends.allocation`; docs/runner-protocol.svg is the runner's
side, of `agent.runner_protocol`.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from docs.pictures.svg import arc, arrow, box, page, text
from swarmwire.agent import runner_protocol
from swarmwire.agent.runner_protocol import WITH_ROBOTS
from swarmwire.world.backends import allocation

DOCS = Path(__file__).parents[1]
Moves = Mapping[str, Mapping[str, str]]
Points = Mapping[str, tuple[float, float]]
WORLD: Points = {
    "free": (70.0, 150.0),
    "joined": (240.0, 150.0),
    "ready": (410.0, 150.0),
    "waiting": (600.0, 150.0),
    "dead": (410.0, 280.0),
}
RUNNER: Points = {
    "searching": (60.0, 90.0),
    "joining": (200.0, 90.0),
    "joined": (360.0, 90.0),
    "ready": (520.0, 90.0),
    "acting": (690.0, 90.0),
    "leaving": (520.0, 210.0),
    "ended": (60.0, 210.0),
}
HALF_WIDTH, HALF_HEIGHT = 46.0, 20.0  # of a state's box
RISE = 0.2  # of an arrow back, for its length


def draw(to: Path = DOCS / "runner-states.svg") -> None:
    """Write the figure of the world's side."""
    moves: Moves = {state: {**moves_of_state} for state, moves_of_state in allocation.MOVES.items()}
    shapes = _states(moves, WORLD)
    to.write_text(page("The states of the robots that one runner plays", 680, 320, shapes), encoding="utf-8")


def draw_protocol(to: Path = DOCS / "runner-protocol.svg") -> None:
    """Write the figure of the runner's side, without the moves that lead nowhere and those that all states have."""
    moves: dict[str, dict[str, str]] = {
        state: {move: after for move, after in moves_of_state.items() if after not in ("ended", state)}
        for state, moves_of_state in runner_protocol.MOVES.items()
    }
    shared = _shared(moves, WITH_ROBOTS)  # moves that start from the frame around these states
    for state in WITH_ROBOTS:
        moves[state] = {move: after for move, after in moves[state].items() if move not in shared}
    (left, y), (right, _), margin = RUNNER[WITH_ROBOTS[0]], RUNNER[WITH_ROBOTS[-1]], HALF_WIDTH + 12.0
    shapes = [box(left - margin, y - 66.0, right - left + 2 * margin, 98.0, "#f1f5f9")]
    for move, after in sorted(shared.items()):
        x, to_y = RUNNER[after]
        shapes += [arrow(x, y + 32.0, x, to_y - HALF_HEIGHT), text(x + 9, 0.5 * (y + to_y) + 10.0, move)]
    shapes += [*_states(moves, RUNNER), text(10.0, 250.0, "from every state: the world ends the run, or is gone")]
    to.write_text(page("The states of a runner", 760, 265, shapes), encoding="utf-8")


def _shared(moves: Moves, states: Sequence[str]) -> dict[str, str]:
    """The moves that all these states have, to the same state."""
    first, *others = (moves[state] for state in states)
    return {
        move: after
        for move, after in first.items()
        if all(moves_of_state.get(move) == after for moves_of_state in others)
    }


def _states(moves: Moves, points: Points) -> list[str]:
    """Every state of the table once, every move from it an arrow."""
    shapes = [
        shape
        for state, moves_of_state in moves.items()
        for move, after in moves_of_state.items()
        for shape in _arrow(points, state, move, after)
    ]
    for state in moves:
        x, y = points[state]
        shapes.append(box(x - HALF_WIDTH, y - HALF_HEIGHT, 2 * HALF_WIDTH, 2 * HALF_HEIGHT, "#dbeafe"))
        shapes.append(text(x, y + 5, state, 14, anchor="middle", bold=True))
    return shapes


def _arrow(points: Points, state: str, move: str, after: str) -> list[str]:
    (x, y), (to_x, to_y) = points[state], points[after]
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
    draw_protocol()
