"""Messages: what robots say to one another, with the exact bytes that go on air.

    class Beacon(Message):
        heading_rad: f4

A message on air is a 2-byte tag made from its class name and fields, then its fields packed little-endian. To the type
checker a field is a `float`, in the constructor and when read: a decoded field is widened to float64 whatever its width
on air, so that both kinds of agent compute with the same numbers.
"""

from collections.abc import Iterable
from hashlib import blake2b
from typing import Annotated, Any, ClassVar, Self, cast, dataclass_transform, get_args, get_origin, get_type_hints

import msgpack
import numpy as np

from swarmwire.comms.arrays import FloatArray, IntArray
from swarmwire.comms.packets import TAG_BYTES, Payloads, offsets

f4 = Annotated[float, np.dtype("<f4")]
f8 = Annotated[float, np.dtype("<f8")]
i1 = Annotated[float, np.dtype("<i1")]
i2 = Annotated[float, np.dtype("<i2")]
i4 = Annotated[float, np.dtype("<i4")]
u1 = Annotated[float, np.dtype("<u1")]
u2 = Annotated[float, np.dtype("<u2")]
u4 = Annotated[float, np.dtype("<u4")]

DICT_TAG = 0  # a dict in msgpack, for prototypes; no class has this tag


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Message:
    """Base of all messages; subclasses declare their fields with `f4`, `f8`, `i1` … `u4`.

    Raises TypeError where a class declares a field of another type or an instance is made with a missing or unknown
    field; `encode` raises OverflowError where a number does not fit its field.
    """

    layout: ClassVar[np.dtype[Any]] = np.dtype([])
    tag: ClassVar[int] = -1
    size_bytes: ClassVar[int] = TAG_BYTES

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        fields: list[tuple[str, np.dtype[Any]]] = []
        for name, hint in get_type_hints(cls, include_extras=True).items():
            if get_origin(hint) is ClassVar:
                continue
            if hasattr(Message, name):
                raise TypeError(f"{cls.__name__}.{name}: the name is taken by Message")
            dtype: object = get_args(hint)[-1] if get_origin(hint) is Annotated else None
            if not isinstance(dtype, np.dtype):
                raise TypeError(f"{cls.__name__}.{name}: expected one of f4, f8, i1, i2, i4, u1, u2, u4")
            fields.append((name, cast("np.dtype[Any]", dtype)))
        cls.layout = np.dtype(fields)
        cls.size_bytes = TAG_BYTES + cls.layout.itemsize
        cls.tag = _tag(cls.__name__, fields)

    def __init__(self, **fields: float) -> None:
        names = self.layout.names or ()
        if set(fields) != set(names):
            raise _wrong_fields(type(self), fields)
        for name, value in fields.items():
            object.__setattr__(self, name, float(value))

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"a message is frozen: {type(self).__name__}.{name}")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), *self.__dict__.items()))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self.__dict__.items())})"

    def encode(self) -> bytes:
        """The bytes on air: tag and fields."""
        columns = {name: np.array([getattr(self, name)]) for name in self.layout.names or ()}
        return encode_rows(type(self), 1, columns).row(0)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """The message of these bytes; ValueError if they are not of this class."""
        if len(payload) != cls.size_bytes or int.from_bytes(payload[:TAG_BYTES], "little") != cls.tag:
            raise ValueError(f"{len(payload)} bytes that are no {cls.__name__}")
        fields = np.frombuffer(payload, cls.layout, 1, TAG_BYTES)[0] if cls.layout.names else None
        return cls(**{name: float(fields[name]) for name in cls.layout.names or ()} if fields is not None else {})


def encode_rows(kind: type[Message], rows: int, fields: dict[str, Any]) -> Payloads:
    """`rows` messages of one class at once; each field is a number or an array (rows,)."""
    names = kind.layout.names or ()
    if set(fields) != set(names):
        raise _wrong_fields(kind, fields)
    table = np.zeros(rows, np.dtype([("tag", "<u2"), ("body", kind.layout)]))
    table["tag"] = kind.tag
    for name in names:
        column = table["body"][name]
        values = np.broadcast_to(np.asarray(fields[name], np.float64), (rows,))
        if column.dtype.kind in "iu":
            values = _whole(kind, name, values, column.dtype)
        elif np.any(np.isfinite(values) & (np.abs(values) > np.finfo(column.dtype).max)):
            raise OverflowError(f"{kind.__name__}.{name}: expected numbers up to {np.finfo(column.dtype).max:g}")
        column[:] = values
    return Payloads(table.view(np.uint8).reshape(-1), offsets(np.full(rows, kind.size_bytes, np.int64)))


def decode_rows(kind: type[Message], payloads: Payloads, index: IntArray) -> dict[str, FloatArray]:
    """The fields of payload rows `index`, which must all be of this class, each as float64 (len(index),)."""
    if not kind.layout.names:
        return {}
    start = payloads.offset[index] + TAG_BYTES
    raw = payloads.data[start[:, None] + np.arange(kind.layout.itemsize)]
    table = np.ascontiguousarray(raw).view(kind.layout).reshape(-1)
    return {name: table[name].astype(np.float64) for name in kind.layout.names}


def encode_dict(message: dict[str, Any]) -> bytes:
    """A dict on air: the dict tag, then msgpack."""
    return DICT_TAG.to_bytes(TAG_BYTES, "little") + msgpack.packb(message)


def decode_dict(payload: bytes) -> dict[str, Any]:
    """The dict of these bytes; ValueError if they hold none."""
    message: object = msgpack.unpackb(payload[TAG_BYTES:])
    if not isinstance(message, dict):
        raise ValueError("the payload holds no dict")
    return cast("dict[str, Any]", message)


def _wrong_fields(kind: type[Message], given: Iterable[str]) -> TypeError:
    names = kind.layout.names or ("(none)",)
    return TypeError(f"{kind.__name__} has the fields {', '.join(names)}; got {', '.join(given)}")


def _whole(kind: type[Message], name: str, values: FloatArray, dtype: np.dtype[Any]) -> FloatArray:
    span = np.iinfo(dtype)
    whole = np.rint(values)
    if not np.all((whole >= span.min) & (whole <= span.max)):
        raise OverflowError(f"{kind.__name__}.{name}: expected whole numbers from {span.min} to {span.max}")
    return whole


def _tag(name: str, fields: list[tuple[str, np.dtype[Any]]]) -> int:
    text = f"{name}({','.join(f'{field}:{dtype.str}' for field, dtype in fields)})"
    return 1 + int.from_bytes(blake2b(text.encode(), digest_size=2).digest(), "little") % 0xFFFF
