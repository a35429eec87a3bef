"""The colour of an arena's floor, in greys so light that robots, lines and letters stay visible on them."""

from itertools import product
from typing import Any

import numpy as np

from swarmwire.comms.geometry.floor import Floor
from swarmwire.comms.truth import Static
from swarmwire.metrics.drawing.looks import Look

DARKEST = 0.45  # of the page's white: how a shade of 0 is shown


def draw_floor(axes: Any, floor: Floor, static: Static, outline: Any) -> None:
    """Colour `outline`, the artist that is the floor, and draw what is painted on it, within it alone."""
    from matplotlib.patches import Circle, Polygon

    outline.set_facecolor(str(shown(floor.shade)))
    width, height = static.arena_size_m
    if floor.image is not None:
        extent = (-width / 2, width / 2, -height / 2, height / 2)
        image_look: Look = {"cmap": "gray", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest", "zorder": 0.1}
        limits = axes.axis()
        axes.imshow(shown(floor.image.grey / 255.0), extent=extent, aspect=axes.get_aspect(), **image_look)
        axes.axis(limits)
    shifts = (-1, 0, 1) if static.boundary == "torus" else (0,)
    for patch in floor.patches:
        look: Look = {"facecolor": str(shown(patch.shade)), "edgecolor": "none", "zorder": 0.2}
        for across, up in product(shifts, shifts):
            at = patch.x_m + across * width, patch.y_m + up * height
            corners = np.array(patch.points_m) + at if patch.points_m else None
            shape = Circle(at, patch.radius_m, **look) if corners is None else Polygon(corners, **look)
            axes.add_patch(shape)
            shape.set_clip_path(outline)


def shown(shade: Any) -> Any:
    """How bright a shade 0 … 1, or an array of them, is drawn."""
    return DARKEST + (1.0 - DARKEST) * shade
