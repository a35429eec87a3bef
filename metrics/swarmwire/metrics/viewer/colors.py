"""What is drawn in which colour (red, green and blue of 255), and texts that the viewer has letters for."""

from swarmwire.comms.packets import Fate
from swarmwire.metrics.palette import Color

DEAD = (118, 118, 124)
WALL = (150, 155, 170)
LIGHT = (255, 220, 60)
MARK = (235, 235, 240)

SERIES: tuple[Color, ...] = (
    (86, 180, 233),
    (240, 228, 66),
    (0, 200, 140),
    (230, 120, 40),
    (204, 121, 167),
    (180, 180, 190),
)
FATES: dict[Fate, Color] = {
    Fate.RECEIVED: (86, 180, 233),
    Fate.BLOCKED: (240, 180, 60),
    Fate.LOST: (235, 85, 75),
    Fate.QUEUE_FULL: (160, 140, 250),
    Fate.TOO_LARGE: (205, 205, 110),
    Fate.IN_FLIGHT: (0, 200, 140),
    Fate.SENDER_DEAD: (125, 125, 135),
    Fate.RECEIVER_DEAD: (175, 175, 185),
    Fate.BLACKOUT: (190, 95, 235),
    Fate.PARTITIONED: (255, 130, 195),
}  # out of range is no colour: such receivers are counted, never listed

_LAST_LETTER = "\u024f"  # of Latin with its extensions


def packed(color: Color, alpha: int) -> int:
    """A colour and its opacity of 255 as the number 0xRRGGBBAA, which rerun takes fastest."""
    red, green, blue = color
    return red << 24 | green << 16 | blue << 8 | alpha


def shown(text: str) -> str:
    """The text with `?` for letters that the viewer's only font may lack: drawing without a screen, it ends at one."""
    return "".join(letter if " " <= letter <= _LAST_LETTER else "?" for letter in text)
