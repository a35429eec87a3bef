"""Films as GIF: one palette for all frames, and of each only what changed."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from swarmwire.comms.arrays import ByteArray, IntArray
from swarmwire.comms.extras import REPORT

COLORS = 64
EVEN_COLORS = 24  # of these, of areas
_SAME = 6  # steps of a colour that make no difference
_MS_STEP = 10  # a GIF counts time in hundredths of a second


def write_gif(to: Path, frames: Iterable[ByteArray], samples: Sequence[ByteArray], frames_per_s: float) -> None:
    """Write frames (height, width, 3) as a film that repeats for ever, with the colours that the samples need.

    Frames that are equal to the one before prolong it. BadInput without the extra [report].
    """
    REPORT.need("films")
    palette = _palette(samples)
    rest = _indexed(frames, palette)
    first = next(rest)
    duration_ms = max(2 * _MS_STEP, _MS_STEP * round(1000.0 / frames_per_s / _MS_STEP))
    first.save(to, "GIF", save_all=True, append_images=rest, duration=duration_ms, loop=0, disposal=1, optimize=True)


def _palette(samples: Sequence[ByteArray]) -> Any:
    """The colours of even areas as they are, which are the most frequent, and means of those at their edges."""
    from PIL import Image

    parts = np.concatenate([sample.reshape(-1, 3) for sample in samples]).astype(np.int64)
    packed, counts = np.unique(parts @ (1 << 16, 1 << 8, 1), return_counts=True)
    frequent = packed[np.argsort(-counts, kind="stable")]
    color = np.stack([frequent >> 16, frequent >> 8 & 255, frequent & 255], axis=1)
    means = Image.fromarray(color[None].astype(np.uint8)).quantize(COLORS - EVEN_COLORS).getpalette() or []
    chosen = _apart(np.empty((0, 3), np.int64), color, EVEN_COLORS)
    chosen = _apart(chosen, np.array(means, np.int64).reshape(-1, 3), COLORS)
    palette = Image.new("P", (1, 1))
    palette.putpalette(chosen.ravel().tolist())
    return palette


def _apart(chosen: IntArray, candidates: IntArray, most: int) -> IntArray:
    """The chosen colours, and as many candidates as there is room for that are none of them nor almost one.

    Pillow looks colours up to within four steps, and might take what is almost a colour for it.
    """
    for candidate in candidates:
        if len(chosen) == most:
            break
        if not len(chosen) or np.abs(chosen - candidate).max(axis=1).min() > _SAME:
            chosen = np.concatenate([chosen, candidate[None]])
    return chosen


def _indexed(frames: Iterable[ByteArray], palette: Any) -> Iterator[Any]:
    from PIL import Image

    for frame in frames:
        # Without dithering, so that what stands still is equal from frame to frame and costs nothing.
        yield Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
