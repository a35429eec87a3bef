"""Messages between robots, with the exact bytes that go on air.

    >>> class Beacon(Message):
    ...     heading_rad: f4
    >>> on_air = Beacon(heading_rad=0.5).encode()
    >>> len(on_air), Beacon.decode(on_air)
    (6, Beacon(heading_rad=0.5))

On air, a message is a 2-byte tag derived from its class name and fields, followed by its fields, packed little-endian.
For the type checker every field is a `float`: decoding widens it from its width on air to float64, so that both kinds
of agent compute with the same numbers.
"""

import struct
from collections.abc import Iterable, Iterator
from hashlib import blake2b
from typing import (
    Annotated,
    Any,
    ClassVar,
    NamedTuple,
    Self,
    cast,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.base.sentinels import NO_TAG
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads

f4 = Annotated[float, np.dtype("<f4")]  # float32 on air
f8 = Annotated[float, np.dtype("<f8")]  # float64 on air
i1 = Annotated[float, np.dtype("<i1")]  # int8 on air
i2 = Annotated[float, np.dtype("<i2")]  # int16 on air
i4 = Annotated[float, np.dtype("<i4")]  # int32 on air
u1 = Annotated[float, np.dtype("<u1")]  # uint8 on air
u2 = Annotated[float, np.dtype("<u2")]  # uint16 on air
u4 = Annotated[float, np.dtype("<u4")]  # uint32 on air

# dtype: its format character in `struct`
STRUCT_FORMATS = {"<f4": "f", "<f8": "d", "|i1": "b", "<i2": "h", "<i4": "i", "|u1": "B", "<u2": "H", "<u4": "I"}
SEND_PARAMETERS = ("rows", "to")  # parameters of a VectorAgent's `send`; the others are the fields of the message
DICT_TAG = 0  # tag of a dict in msgpack, for prototypes; no class has this tag
RELAY_TAG = FRAME_TAG + 1  # tag of a packet of the relay of ROS 2 topics
CRTP_TAG = FRAME_TAG + 2  # tag of a CRTP packet of a Crazyflie; not on air: esb carries the packet alone
RESERVED_TAGS = (FRAME_TAG, RELAY_TAG, CRTP_TAG)  # tags of packets that are no messages


class FieldRange(NamedTuple):
    """The numbers that fit a field of a message."""

    lowest: float
    highest: float
    is_integer: bool


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Message:
    """The base class of messages; subclasses declare their fields with `f4`, `f8`, `i1` … `u4`.

    A class definition raises TypeError for a field of another type or with a default; the constructor raises it for a
    missing or unknown field, or a value that is no number. `encode` rounds the values of integer fields, and raises
    OverflowError if a number does not fit its field.
    """

    tag: ClassVar[int] = NO_TAG
    size_bytes: ClassVar[int] = TAG_BYTES
    on_air: ClassVar[np.dtype[Any]] = np.dtype([("tag", "<u2")])  #: tag and fields, packed
    ranges: ClassVar[dict[str, FieldRange]] = {}  #: range of each field, by name
    byte_index: ClassVar[IntArray] = np.arange(TAG_BYTES)  #: (size_bytes,) 0, 1, 2, …
    packing: ClassVar[struct.Struct] = struct.Struct("<H")  #: the layout of `on_air`, to pack a single message

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        fields: list[tuple[str, np.dtype[Any]]] = []
        for name, hint in get_type_hints(cls, include_extras=True).items():
            if get_origin(hint) is ClassVar:
                continue
            if hasattr(Message, name) or name in SEND_PARAMETERS:
                owner = "send" if name in SEND_PARAMETERS else "Message"
                raise TypeError(f"{cls.__name__}.{name}: the name is taken by {owner}")
            dtype: object = get_args(hint)[-1] if get_origin(hint) is Annotated else None
            if not isinstance(dtype, np.dtype):
                raise TypeError(f"{cls.__name__}.{name}: expected one of f4, f8, i1, i2, i4, u1, u2, u4")
            if name in vars(cls):
                raise TypeError(f"{cls.__name__}.{name}: a field has no default, every message sets all of them")
            fields.append((name, cast("np.dtype[Any]", dtype)))
        cls.tag = _tag(cls.__name__, fields)
        cls.on_air = np.dtype([("tag", "<u2"), *fields])
        cls.size_bytes = cls.on_air.itemsize
        cls.byte_index = np.arange(cls.size_bytes)
        cls.packing = struct.Struct("<H" + "".join(STRUCT_FORMATS[dtype.str] for _, dtype in fields))
        cls.ranges = {name: _range(dtype) for name, dtype in fields}

    def __init__(self, **fields: float) -> None:
        if fields.keys() != self.ranges.keys():
            raise _wrong_fields(type(self), fields)
        for name, value in fields.items():
            try:
                object.__setattr__(self, name, float(value))
            except (TypeError, ValueError):
                raise TypeError(f"{type(self).__name__}.{name}: expected a number, got {value!r}") from None

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
        fields = self.__dict__
        try:
            values = [
                round(fields[name]) if is_integer else fields[name] for name, (_, _, is_integer) in self.ranges.items()
            ]
            return self.packing.pack(self.tag, *values)
        except (OverflowError, ValueError, struct.error):  # a number does not fit: `encode_rows` names the field
            return encode_rows(type(self), 1, dict(fields)).row(0)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Decode a payload; ValueError unless it is a message of this class."""
        if len(payload) != cls.size_bytes or int.from_bytes(payload[:TAG_BYTES], "little") != cls.tag:
            raise ValueError(f"{len(payload)} bytes that are no {cls.__name__}")
        return cls.decode_at(payload, 0)

    @classmethod
    def decode_at(cls, data: bytes, start: int) -> Self:
        """Decode the message that starts at byte `start`; its tag and size must already be checked."""
        _, *numbers = cls.packing.unpack_from(data, start)
        message = object.__new__(cls)  # decoded fields need no check by __init__
        message.__dict__.update(zip(cls.ranges, map(float, numbers), strict=True))
        return message


def message_classes(base: type[Message] = Message) -> Iterator[type[Message]]:
    """All subclasses of `base`, direct and indirect, in this process."""
    for kind in base.__subclasses__():
        yield kind
        yield from message_classes(kind)


def message_class(kind: object) -> type[Message]:
    """Return `kind`; TypeError unless it is a class of messages."""
    if not isinstance(kind, type) or not issubclass(kind, Message) or kind is Message:
        raise TypeError(f"expected a class of messages, got {kind!r}")
    return kind


def encode_rows(kind: type[Message], rows: int, fields: dict[str, Any]) -> Payloads:
    """Encode `rows` messages of one class; each field is a number or an array (rows,)."""
    if fields.keys() != kind.ranges.keys():
        raise _wrong_fields(kind, fields)
    table = np.empty(rows, kind.on_air)
    table["tag"] = kind.tag
    for name, field_range in kind.ranges.items():
        values = np.asarray(fields[name], np.float64)
        if values.shape not in ((), (rows,)):
            raise ValueError(f"{kind.__name__}.{name}: expected one number or an array ({rows},), got {values.shape}")
        try:
            if field_range.is_integer:
                table[name] = _rounded(values, field_range)
            else:
                with np.errstate(over="raise"):
                    table[name] = values
        except (FloatingPointError, OverflowError):
            raise _out_of_range(f"{kind.__name__}.{name}", values, field_range) from None
    return Payloads(table.view(np.uint8), np.arange(rows + 1) * kind.size_bytes)


def decode_alike(kind: type[Message], payloads: Payloads, index: IntArray) -> dict[str, FloatArray] | None:
    """Decode like `decode_rows`, but faster, if all payloads are of this class; return None otherwise."""
    if (payloads.sizes != kind.size_bytes).any():
        return None
    table = payloads.data.view(kind.on_air)
    if (table["tag"] != kind.tag).any():
        return None
    return {name: table[name].astype(np.float64).take(index) for name in kind.ranges}


def decode_rows(kind: type[Message], payloads: Payloads, index: IntArray) -> dict[str, FloatArray]:
    """Decode the payloads `index` (k,), which must all be of this class, to its fields, each float64 (k,)."""
    if not kind.ranges:
        return {}
    raw = payloads.data[payloads.offset[index, None] + kind.byte_index]
    table = raw.view(kind.on_air)[:, 0]
    return {name: table[name].astype(np.float64) for name in kind.ranges}


def encode_dict(message: dict[str, Any]) -> bytes:
    """Encode a dict: the dict tag, then msgpack. TypeError unless its keys are texts and msgpack takes its values."""
    payload = DICT_TAG.to_bytes(TAG_BYTES, "little") + msgpack.packb(message)
    decoded = dict_in(payload)  # an error here reaches the sender, who made it, instead of the receivers
    if decoded is None or not all(type(key) is str for key in decoded):
        raise TypeError(f"a dict message has texts as keys, got {list(message)}")
    return payload


def decode_dict(payload: bytes) -> dict[str, Any]:
    """Decode a payload to a dict; ValueError if it holds none."""
    try:
        message: object = msgpack.unpackb(payload[TAG_BYTES:], strict_map_key=False)
    except (TypeError, UnpackException) as error:  # TypeError: a list as a key; other faults are ValueErrors
        raise ValueError(f"the payload holds no dict: {error}") from error
    if not isinstance(message, dict):
        raise ValueError("the payload holds no dict")
    return cast("dict[str, Any]", message)


def dict_in(payload: bytes) -> dict[str, Any] | None:
    """Decode a payload to a dict; None if it holds none, since the sender may run any code."""
    try:
        return decode_dict(payload)
    except ValueError:
        return None


def _wrong_fields(kind: type[Message], fields: Iterable[str]) -> TypeError:
    names = kind.ranges or ("(none)",)
    return TypeError(f"{kind.__name__} has the fields {', '.join(names)}; got {', '.join(fields) or 'none'}")


def _out_of_range(name: str, values: FloatArray, field_range: FieldRange) -> OverflowError:
    """The error for the first value that does not fit a field."""
    lowest, highest, is_integer = field_range
    numbers = np.rint(values) if is_integer else values
    wrong = float(numbers[~((numbers >= lowest) & (numbers <= highest))].flat[0])
    kind = "whole numbers" if is_integer else "numbers"
    return OverflowError(f"{name}: expected {kind} from {lowest:.10g} to {highest:.10g}, got {wrong:.10g}")


def _rounded(values: FloatArray, field_range: FieldRange) -> FloatArray:
    """Round values to integers; OverflowError if one is out of range."""
    integers = np.rint(values)
    if not ((integers >= field_range.lowest) & (integers <= field_range.highest)).all():
        raise OverflowError
    return integers


def _range(dtype: np.dtype[Any]) -> FieldRange:
    is_integer = dtype.kind in "iu"
    limits = np.iinfo(dtype) if is_integer else np.finfo(dtype)
    return FieldRange(float(limits.min), float(limits.max), is_integer)


def _tag(name: str, fields: list[tuple[str, np.dtype[Any]]]) -> int:
    text = f"{name}({','.join(f'{field}:{dtype.str}' for field, dtype in fields)})"
    tag = 1 + int.from_bytes(blake2b(text.encode(), digest_size=2).digest(), "little") % 0xFFFF
    while tag in RESERVED_TAGS:
        tag += 1
    return tag
