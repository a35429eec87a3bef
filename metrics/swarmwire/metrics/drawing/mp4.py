"""Films as MP4 (H.264), which every browser plays, by the ffmpeg that imageio-ffmpeg brings."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

import numpy as np

from swarmwire.comms.arrays import ByteArray
from swarmwire.comms.extras import REPORT

_QUALITY = "20"  # x264's constant rate factor: lower is better, 18 is taken for visually lossless


def write_mp4(to: Path, frames: Iterable[ByteArray], frames_per_s: float) -> None:
    """Write frames (height, width, 3), with even sides, as a film. BadInput without the extra [report]."""
    REPORT.need("films")
    import imageio_ffmpeg

    ffmpeg: Any = None
    try:
        for frame in frames:
            if ffmpeg is None:
                height, width = frame.shape[:2]
                kind: dict[str, Any] = {"codec": "libx264", "pix_fmt_in": "rgb24", "pix_fmt_out": "yuv420p"}
                form: dict[str, Any] = {"size": (width, height), "macro_block_size": 2, "fps": frames_per_s}
                how: dict[str, Any] = {"quality": None, "output_params": ["-crf", _QUALITY, "-movflags", "+faststart"]}
                ffmpeg = cast("Any", imageio_ffmpeg).write_frames(str(to), **kind, **form, **how)
                ffmpeg.send(None)
            ffmpeg.send(np.ascontiguousarray(frame))
    finally:
        if ffmpeg is not None:
            ffmpeg.close()
