"""Draws docs/runner-states.svg from the table of moves: how a runner comes, is asked, answers and goes."""

from collections.abc import Iterator
from pathlib import Path

from swarmwire.world.crews.slot import MOVES, State

TO = Path(__file__).parents[1] / "runner-states.svg"
PLACES: dict[State, tuple[int, int]] = {
    "free": (70, 150),
    "joined": (240, 150),
    "ready": (410, 150),
    "waiting": (600, 150),
    "dead": (410, 290),
}
HALF_WIDTH, HALF_HEIGHT = 46, 20  # of a state's box
RISE = 0.2  # of an arrow back, for its length

HEAD = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 680 330" width="680" height="330" font-family="sans-serif" \
font-size="14" role="img">
  <title>The states of the robots that one runner plays</title>
  <defs>
    <marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">
      <path d="M0 0 L10 5 L0 10 z" fill="#334155"/>
    </marker>
  </defs>
  <rect width="680" height="330" rx="8" fill="#ffffff"/>
"""


def picture() -> str:
    """The drawing as SVG: every state of the table once, every move from it an arrow."""
    return "\n".join([HEAD, *_arrows(), *_boxes(), "</svg>\n"])


def _boxes() -> Iterator[str]:
    for state in MOVES:
        x, y = PLACES[state]
        size = f'width="{2 * HALF_WIDTH}" height="{2 * HALF_HEIGHT}" rx="6"'
        yield f'  <rect x="{x - HALF_WIDTH}" y="{y - HALF_HEIGHT}" {size} fill="#dbeafe" stroke="#1d4ed8"/>'
        yield f'  <text x="{x}" y="{y + 5}" text-anchor="middle" font-weight="bold" fill="#1e3a8a">{state}</text>'


def _arrows() -> Iterator[str]:
    for state, moves in MOVES.items():
        for move, to in moves.items():
            path, x, y = _way(*PLACES[state], *PLACES[to])
            yield f'  <path d="{path}" stroke="#334155" stroke-width="1.6" fill="none" marker-end="url(#tip)"/>'
            halo = 'stroke="#ffffff" stroke-width="5" paint-order="stroke"'
            yield f'  <text x="{x:g}" y="{y:g}" text-anchor="middle" fill="#334155" {halo}>{move}</text>'


def _way(x: int, y: int, to_x: int, to_y: int) -> tuple[str, float, float]:
    """The path of an arrow between two places, and where its label stands."""
    middle_x, middle_y = 0.5 * (x + to_x), 0.5 * (y + to_y)
    if to_y > y:
        return f"M{x} {y + HALF_HEIGHT} L{to_x + 0.2 * (x - to_x):g} {to_y - HALF_HEIGHT}", middle_x, middle_y + 5
    if to_x > x:
        return f"M{x + HALF_WIDTH} {y} H{to_x - HALF_WIDTH}", middle_x, y - 6
    top, rise = y - HALF_HEIGHT, RISE * (x - to_x)
    start, end = x - 0.3 * HALF_WIDTH, to_x + 0.3 * HALF_WIDTH
    return f"M{start:g} {top} Q{middle_x:g} {top - 2 * rise:g} {end:g} {top}", middle_x, top - rise + 5


if __name__ == "__main__":
    TO.write_text(picture(), encoding="utf-8")
