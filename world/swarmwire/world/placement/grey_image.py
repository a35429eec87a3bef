"""Pictures as greys: maps of obstacles and floors are given so."""

from pathlib import Path
from typing import TYPE_CHECKING
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.errors import BadInput

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF")  # PGM is one of PPM's family
MOST_PIXELS = 2**24

GreyArray = NDArray[np.float32]


def beside(where: str, name: str) -> Path:
    """The path of a file that a scenario names, which lies beside the scenario."""
    return Path(where).parent / name


def read_grey(path: Path, where: str, key: str) -> GreyArray:
    """The greys of a picture, (rows, columns), 0 black … 1 white, top row first; on white where it is transparent.

    BadInput names `where` and `key` for a file that is no picture, or one of more than `MOST_PIXELS`.
    """
    from PIL import Image

    too_large = BadInput(where, key, f"expected a picture of at most {MOST_PIXELS} pixels: {path}")
    try:
        with catch_warnings():
            simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                if image.width * image.height > MOST_PIXELS:
                    raise too_large
                return _greys(image)
    except FileNotFoundError:
        raise BadInput(where, key, f"expected a file beside the scenario: there is no {path}") from None
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise too_large from None
    except (OSError, ValueError, SyntaxError, EOFError, IndexError):  # Pillow's, by where a file is broken
        raise BadInput(where, key, f"expected a picture, PNG, PGM, BMP, JPEG or GIF: {path}") from None


def _greys(image: "Image.Image") -> GreyArray:
    from PIL import Image

    if image.mode.startswith("I"):  # 16 bits a pixel
        return np.asarray(image, np.float32) / np.float32(65535)
    if image.has_transparency_data:
        white = Image.new("RGBA", image.size, "white")
        image = Image.alpha_composite(white, image.convert("RGBA"))
    return np.asarray(image.convert("L"), np.float32) / np.float32(255)
