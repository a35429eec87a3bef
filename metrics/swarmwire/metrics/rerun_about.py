"""What a recording is of, in words, for people who open it without having seen the scenario."""

from swarmwire.comms.truth import Static
from swarmwire.metrics.rerun_colors import shown


def about(static: Static, arena: int, selected: str, links_every_ticks: int) -> str:
    """Markdown: the run, and how to read the picture."""
    size = " × ".join(f"{side:.3g}" for side in static.arena_size_m)
    groups = ", ".join(f"{group.stop - group.start} × {group.body.name} ({group.name})" for group in static.groups)
    lines = [
        f"**{static.name}**, seed {static.seeds[arena]}",
        "",
        f"{groups} in {size} m, {static.rate_hz} ticks per second",
        "",
        f"The ring marks {selected}. Its rays: red meets a robot, white a wall or an obstacle, faint nothing; "
        "yellow bars: light.",
    ]
    if static.range_m is not None:
        often = "" if links_every_ticks == 1 else f" (every {links_every_ticks} ticks)"
        lines += [
            "",
            f"The radio reaches {static.range_m:.3g} m: the large circle. Grey lines join robots in reach; "
            f"coloured ones are packets that ended unheard{often}, in the colour of their fate in the plot of packets.",
        ]
    return "\n".join(shown(line) for line in lines)
