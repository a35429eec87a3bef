"""The colours of robots: one a group, and the same in every view and picture."""

Color = tuple[int, int, int]  # red, green, blue, 0 to 255

GROUP_COLORS: tuple[Color, ...] = (
    (86, 180, 233),
    (240, 160, 50),
    (0, 200, 140),
    (230, 110, 180),
    (240, 228, 66),
    (160, 140, 250),
)


def group_color(index: int) -> Color:
    """The colour of the group at this place in the scenario; they come round again after the last."""
    return GROUP_COLORS[index % len(GROUP_COLORS)]
