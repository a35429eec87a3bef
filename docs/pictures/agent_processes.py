"""Draws docs/agent-processes.svg: the processes of a run, their sockets and network sessions."""

from pathlib import Path

from docs.pictures.svg import arrow, box, page, text

DOCS = Path(__file__).parents[1]
WORLD, HOST, AGENT, MACHINE, FOREIGN = "#fde68a", "#bfdbfe", "#dbeafe", "#f8fafc", "#e9d5ff"
WORLD_X, HOST_Y, AGENT_Y = 400.0, 150.0, 270.0
STEP = 66.0  # from one agent process to the next


def draw(to: Path = DOCS / "agent-processes.svg") -> None:
    """Write the figure."""
    shapes = [
        *_machine(20.0, "machine 1, with the world", 0, 5),
        *_machine(380.0, "machine 2: swarmwire-agent join", 5, 3),
        *_process(700.0, HOST_Y, FOREIGN, "foreign runner", "any language", "its own session"),
        *_process(WORLD_X, 16.0, WORLD, "world", "physics, radio,", "metrics, records"),
        *(arrow(WORLD_X + at, 76.0, to_x, HOST_Y) for at, to_x in ((-40.0, 190.0), (0.0, 484.0), (40.0, 690.0))),
        text(250.0, 116.0, "①", 14),
        text(452.0, 124.0, "①", 14),
        text(566.0, 110.0, "①", 14),
        text(20.0, 350.0, "① a zenoh session: one frame to the host and one back in each tick", 13),
        text(20.0, 371.0, "② a pair of Unix sockets: one frame to the process, one back; it has no other socket", 13),
    ]
    title = "One zenoh session for each agent host, one socket pair for each agent process"
    to.write_text(page(title, 790.0, 384.0, shapes), encoding="utf-8")


def _machine(left: float, title: str, first: int, processes: int) -> list[str]:
    width = STEP * processes + 14.0
    middle = left + 0.5 * width
    shapes = [box(left, HOST_Y - 16.0, width, 190.0, MACHINE), text(left + 10.0, AGENT_Y + 46.0, title, 11)]
    shapes += _process(middle, HOST_Y, HOST, "agent host", "forks the agent", "processes")
    for at in range(processes):
        x = left + 10.0 + at * STEP
        shapes += [
            arrow(middle, HOST_Y + 60.0, x + 30.0, AGENT_Y),
            box(x, AGENT_Y, 60.0, 28.0, AGENT),
            text(x + 30.0, AGENT_Y + 18.0, f"robot {first + at}", 11, anchor="middle"),
        ]
    return [*shapes, text(middle + 12.0, AGENT_Y - 22.0, "②", 14)]


def _process(middle: float, y: float, fill: str, name: str, *lines: str) -> list[str]:
    texts = [text(middle, y + 36.0 + 15.0 * at, line, 11, anchor="middle") for at, line in enumerate(lines)]
    return [
        box(middle - 60.0, y, 120.0, 60.0, fill),
        text(middle, y + 18.0, name, 13, anchor="middle", bold=True),
        *texts,
    ]


if __name__ == "__main__":
    draw()
