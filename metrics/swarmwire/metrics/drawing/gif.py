"""Films as GIF: one palette for all frames, and of each only what changed."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.arrays import ByteArray
from swarmwire.metrics.drawing.looks import FLOOR, PAPER
from swarmwire.metrics.report_extra import need_report_extra

COLORS = 64
_SAME = 6  # colours of a palette that differ by no more from a ground are left out for it
_MS_STEP = 10  # a GIF counts time in hundredths of a second


def write_gif(to: Path, frames: Iterable[ByteArray], samples: Sequence[ByteArray], frames_per_s: float) -> None:
    """Write frames (height, width, 3) as a film that repeats for ever, with the colours that the samples need.

    Frames that are equal to the one before prolong it. BadInput without the extra [report].
    """
    need_report_extra("films")
    palette = _palette(samples)
    rest = _indexed(frames, palette)
    first = next(rest)
    duration_ms = max(2 * _MS_STEP, _MS_STEP * round(1000.0 / frames_per_s / _MS_STEP))
    first.save(to, "GIF", save_all=True, append_images=rest, duration=duration_ms, loop=0, disposal=1, optimize=True)


def _palette(samples: Sequence[ByteArray]) -> Any:
    """The grounds as they are, which all else lies on, and the colours into which the samples fall."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    grounds = np.array([[round(255 * share) for share in to_rgb(color)] for color in (PAPER, FLOOR)])
    sampled = Image.fromarray(np.concatenate(list(samples)))
    found = np.array(sampled.quantize(COLORS - len(grounds)).getpalette() or []).reshape(-1, 3)
    # Pillow looks colours up to within four steps, and might take what is almost a ground for it.
    apart = np.abs(found[:, None] - grounds).max(axis=2).min(axis=1) > _SAME
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.concatenate([grounds, found[apart]]).ravel().tolist())
    return palette


def _indexed(frames: Iterable[ByteArray], palette: Any) -> Iterator[Any]:
    from PIL import Image

    for frame in frames:
        # Without dithering, so that what stands still is equal from frame to frame and costs nothing.
        yield Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
