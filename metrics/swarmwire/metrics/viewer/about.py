"""What a recording is of, in words, for people who open it without having seen the scenario."""

from swarmwire.comms.truth import Static
from swarmwire.metrics.viewer.colors import shown


def about(static: Static, arena: int, selected: str, links_every_ticks: int) -> str:
    """Markdown: the run, and how to read the picture."""
    size = " × ".join(f"{side:.3g}" for side in static.arena_size_m)
    groups = ", ".join(f"{group.stop - group.start} × {group.body.name} ({group.name})" for group in static.groups)
    lines = [
        f"**{static.name}**, seed {static.seeds[arena]}",
        "",
        f"{groups} in {size} m, {static.rate_hz} ticks per second",
        "",
        " ".join([f"The ring marks {selected}.", *_drawn(static, selected)]),
    ]
    if static.range_m is not None:
        often = "" if links_every_ticks == 1 else f" (every {links_every_ticks} ticks)"
        lines += [
            "",
            f"The radio reaches {static.range_m:.3g} m: the large circle. Grey lines join robots in reach; "
            f"coloured ones are packets that ended unheard{often}, in the colour of their fate in the plot of packets.",
        ]
    return "\n".join(shown(line) for line in lines)


def _drawn(static: Static, selected: str) -> list[str]:
    """What the selected robot's body lets the picture show of its sensors."""
    index = static.robot_names.index(selected)
    body = next(group.body for group in static.groups if group.start <= index < group.stop)
    rays = ["Its rays: red meets a robot, white a wall or an obstacle, faint nothing."] if body.proximity else []
    return [*rays, "Yellow bars: light."] if body.light else rays
