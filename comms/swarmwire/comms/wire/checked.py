"""Arrays of a frame that came over the wire, checked before they are used."""

from swarmwire.comms.arrays import AnyArray
from swarmwire.comms.errors import BadFrame
from swarmwire.comms.wire.frames import DTYPES, Frame


def checked_array(frame: Frame, name: str, code: str, shape: tuple[int | None, ...]) -> AnyArray:
    """An array of the frame, of this dtype and shape (None: any length); BadFrame otherwise."""
    array = frame.arrays.get(name)
    if array is not None and array.dtype == DTYPES[code] and array.ndim == len(shape):
        for want, got in zip(shape, array.shape, strict=True):
            if want is not None and want != got:
                break
        else:
            return array
    raise BadFrame("malformed", f"{name}: expected {code} of shape {shape}")
