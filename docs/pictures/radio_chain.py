"""Draws docs/radio-chain.svg: the steps of the radio from sender to receiver, with the fates of each step."""

from dataclasses import dataclass
from pathlib import Path

from docs.pictures.svg import INK, arrow, box, page, text

TO = Path(__file__).parents[1] / "radio-chain.svg"
SENDER, LINK, RECEIVER, AGENT = "#fae8ff", "#dbeafe", "#dcfce7", "#fef3c7"
WIDTH, HEIGHT, GAP, LEFT = 122.0, 76.0, 16.0, 10.0
ROWS_Y = (38.0, 214.0)


@dataclass(frozen=True)
class Step:
    """A box of the drawing: its title, models or keys, and the fates of packets that end there."""

    fill: str
    title: str
    lines: tuple[str, ...]
    fates: tuple[str, ...] = ()
    is_phy: bool = False  # a unit disk has no such step


STEPS = (
    (
        Step(AGENT, "agent", ("radio.send(…)",), ("too_large",)),
        Step(SENDER, "queue", ("queue_limit,", "queue_lifetime_s"), ("queue_full", "sender_dead")),
        Step(
            SENDER,
            "medium access",
            ("none, aloha, cad, esb,", "csma-802154, dcf,", "advertising"),
            ("channel_busy", "duty_cycle"),
            is_phy=True,
        ),
        Step(LINK, "path loss", ("four models;", "disk: range_m"), ("out_of_range",)),
        Step(LINK, "walls, bodies", ("dB by material;", "disk: line of sight"), ("blocked",)),
        Step(LINK, "shadowing", ("a field over", "the arena"), is_phy=True),
    ),
    (
        Step(LINK, "fading", ("Rayleigh, Rician,", "Nakagami"), is_phy=True),
        Step(LINK, "events", ("deaths, blackouts,", "partitions"), ("receiver_dead", "blackout", "partitioned")),
        Step(
            RECEIVER,
            "reception",
            ("SINR, noise,", "capture"),
            ("too_weak", "collided", "jammed", "not_listening"),
            is_phy=True,
        ),
        Step(RECEIVER, "losses", ("loss, bursts,", "trace"), ("lost", "burst")),
        Step(RECEIVER, "delays", ("latency_s, jitter_s,", "[radio.delays]"), ("in_flight",)),
        Step(AGENT, "agent", ("radio.received(…)",), ("received",)),
    ),
)


def draw(to: Path = TO) -> None:
    """Write the figure."""
    width = 2 * LEFT + 6 * WIDTH + 5 * GAP
    shapes = [text(LEFT, 22, "sender", 13, bold=True), text(_x(3), 22, "link", 13, bold=True)]
    shapes += [text(_x(2), ROWS_Y[1] - 16, "receiver", 13, bold=True)]
    for y, steps in zip(ROWS_Y, STEPS, strict=True):
        for i, step in enumerate(steps):
            shapes += _step(_x(i), y, step)
            if i:
                shapes.append(arrow(_x(i) - GAP, y + HEIGHT / 2, _x(i) - 1, y + HEIGHT / 2))
    last, first, between = _x(5) + WIDTH / 2, _x(0) + WIDTH / 2, ROWS_Y[1] - 34
    turn = f"M{last:g} {ROWS_Y[0] + HEIGHT:g} V{between:g} H{first:g} V{ROWS_Y[1] - 1:g}"
    shapes.append(f'<path d="{turn}" stroke="{INK}" fill="none" marker-end="url(#tip)"/>')
    shapes.append(
        text(LEFT, 376, "Below a box: fates of packets that end there. PHY: a unit disk skips this step.", 12)
    )
    to.write_text(page("The radio from sender to receiver", width, 386, shapes), encoding="utf-8")


def _step(x: float, y: float, step: Step) -> list[str]:
    middle = x + WIDTH / 2
    shapes = [box(x, y, WIDTH, HEIGHT, step.fill), text(middle, y + 22, step.title, 13, anchor="middle", bold=True)]
    shapes += [text(middle, y + 42 + 15 * i, line, 11, anchor="middle") for i, line in enumerate(step.lines)]
    if step.is_phy:
        shapes.append(text(x + WIDTH - 5, y + HEIGHT - 5, "PHY", 10, anchor="end"))
    shapes += [text(middle, y + HEIGHT + 18 + 14 * i, fate, 11, anchor="middle") for i, fate in enumerate(step.fates)]
    return shapes


def _x(column: int) -> float:
    return LEFT + column * (WIDTH + GAP)


if __name__ == "__main__":
    draw()
