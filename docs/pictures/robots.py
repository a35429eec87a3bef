"""Draws docs/robots.svg: the processes of a swarm of real robots, and their emulation in a rehearsal."""

from pathlib import Path

from docs.pictures.svg import arrow, box, line, page, text

TO = Path(__file__).parents[1] / "robots.svg"
WIDTH, HEIGHT = 880.0, 424.0
NETWORK_Y, AGENTS_Y, ROBOTS_Y, WORLD_Y = 118.0, 188.0, 300.0, 382.0
COLUMNS = (10.0, 305.0, 600.0)
BOX_WIDTH = 270.0
YOURS, NETWORK, AGENT, ROBOT, WORLD = "#f1f5f9", "#fae8ff", "#dcfce7", "#fef3c7", "#dbeafe"
AGENTS = (
    ("agent of flock-0", "driver epuck2, radio zenoh", "TCP port 1000, Wi-Fi"),
    ("agent of flock-1", "driver epuck2, radio zenoh", "TCP port 1000, Wi-Fi"),
    ("agent of turtle-0", "driver ros2, radio zenoh", "zenoh, port 7447"),
)
ROBOTS = (
    ("e-puck2", "no watchdog: drives on without Wi-Fi"),
    ("e-puck2", "no watchdog: drives on without Wi-Fi"),
    ("TurtleBot", "ROS 2 behind a zenoh bridge"),
)


def draw(to: Path = TO) -> None:
    """Write the figure."""
    shapes = [*_company(), *_network()]
    for x, agent, robot in zip(COLUMNS, AGENTS, ROBOTS, strict=True):
        shapes += _robot(x, agent, robot)
    shapes += [
        line(10, WORLD_Y - 10, WIDTH - 10, WORLD_Y - 10),
        box(10, WORLD_Y, WIDTH - 20, 32, WORLD),
        text(
            WIDTH / 2,
            WORLD_Y + 21,
            "In a rehearsal, swarmwire run --gateway emulates robots, tracker and radio; the agents are the same.",
            anchor="middle",
        ),
    ]
    to.write_text(page("Robots, agents and network", WIDTH, HEIGHT, shapes), encoding="utf-8")


def _company() -> list[str]:
    """The operator's computer and the tracker, above the network."""
    left, right = COLUMNS[0], COLUMNS[2]
    return [
        _titled(left, 10, YOURS, "your computer", "swarmwire robots, swarmwire certs"),
        _titled(right, 10, YOURS, "tracker", "camera system: poses of all robots"),
        text((left + right + BOX_WIDTH) / 2, 34, "deploy, start, stop: by SSH to the agents' hosts", anchor="middle"),
        arrow(left + 60, 62, left + 60, NETWORK_Y - 2),
        text(left + 70, 94, "estop, status"),
        arrow(right + 60, 62, right + 60, NETWORK_Y - 2),
        text(right + 70, 94, "pose/NAME"),
    ]


def _network() -> list[str]:
    caption = "the swarm's network: zenoh over TLS; each member is authenticated by its certificate"
    return [box(10, NETWORK_Y, WIDTH - 20, 34, NETWORK), text(WIDTH / 2, NETWORK_Y + 22, caption, anchor="middle")]


def _robot(x: float, agent: tuple[str, str, str], robot: tuple[str, str]) -> list[str]:
    """An agent, its robot, and what goes between them."""
    middle = x + 60
    return [
        arrow(middle, AGENTS_Y - 2, middle, NETWORK_Y + 36),
        arrow(middle + 10, NETWORK_Y + 36, middle + 10, AGENTS_Y - 2),
        text(middle + 20, AGENTS_Y - 12, "messages, poses"),
        _titled(x, AGENTS_Y, AGENT, agent[0], agent[1]),
        arrow(middle, AGENTS_Y + 54, middle, ROBOTS_Y - 2),
        arrow(middle + 10, ROBOTS_Y - 2, middle + 10, AGENTS_Y + 54),
        text(middle + 20, AGENTS_Y + 86, agent[2]),
        _titled(x, ROBOTS_Y, ROBOT, robot[0], robot[1]),
    ]


def _titled(x: float, y: float, fill: str, title: str, caption: str) -> str:
    return box(x, y, BOX_WIDTH, 52, fill) + text(x + 10, y + 21, title, 14, bold=True) + text(x + 10, y + 40, caption)


if __name__ == "__main__":
    draw()
