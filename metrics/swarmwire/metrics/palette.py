"""The colours of robots: the same in every view and picture."""

Color = tuple[int, int, int]  # red, green, blue, 0 to 255

ROBOT_COLORS: tuple[Color, ...] = (
    (86, 180, 233),
    (240, 160, 50),
    (0, 200, 140),
    (230, 110, 180),
    (160, 140, 250),
    (150, 210, 60),
    (235, 125, 100),
    (90, 210, 220),
    (200, 165, 125),
    (240, 185, 225),
)


def robot_color(index: int) -> Color:
    """The colour of the group, or of the state, that comes at this place; they come round again after the last."""
    return ROBOT_COLORS[index % len(ROBOT_COLORS)]
