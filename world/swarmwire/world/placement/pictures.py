"""Picture files beside a scenario, as arrays: `read_picture` opens and converts one, `read_grey` reads its greys."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from swarmwire.comms.base.errors import BadInput

if TYPE_CHECKING:
    from PIL import Image

FORMATS = ("PNG", "PPM", "BMP", "JPEG", "GIF")  # PGM is one of PPM's family
MAX_PIXELS = 2**24

GreyArray = NDArray[np.float32]
T = TypeVar("T")


def read_grey(path: Path, where: str, key: str) -> GreyArray:
    """Return the grey values of a picture, (rows, columns), 0 black … 1 white, top row first, on a white background.

    BadInput as in `read_picture`.
    """
    return read_picture(path, where, key, _greys)


def read_picture(path: Path, where: str, key: str, convert: "Callable[[Image.Image], T]") -> T:
    """Return a picture as `convert` makes it.

    BadInput names `where` and `key` for a file that is no image, or has more than `MAX_PIXELS`.
    """
    from PIL import Image

    too_large = BadInput(where, key, f"expected a picture of at most {MAX_PIXELS} pixels: {path}")
    try:
        with catch_warnings():
            simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path, formats=FORMATS) as image:
                if image.width * image.height > MAX_PIXELS:
                    raise too_large
                return convert(image)
    except FileNotFoundError:
        raise BadInput(where, key, f"expected a file beside the scenario: there is no {path}") from None
    except (Image.DecompressionBombWarning, Image.DecompressionBombError):
        raise too_large from None
    except (OSError, ValueError, SyntaxError, EOFError, IndexError):  # Pillow raises all of these for broken files
        raise BadInput(where, key, f"expected a picture, PNG, PGM, BMP, JPEG or GIF: {path}") from None


def _greys(image: "Image.Image") -> GreyArray:
    from PIL import Image

    if image.mode.startswith("I"):  # 16 bits a pixel
        return np.asarray(image, np.float32) / np.float32(65535)
    if image.has_transparency_data:
        white = Image.new("RGBA", image.size, "white")
        image = Image.alpha_composite(white, image.convert("RGBA"))
    return np.asarray(image.convert("L"), np.float32) / np.float32(255)
