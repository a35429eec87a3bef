"""Messages between robots, with the exact bytes that go on air.

    >>> class Beacon(Message):
    ...     heading_rad: f4
    >>> on_air = Beacon(heading_rad=0.5).encode()
    >>> len(on_air), Beacon.decode(on_air)
    (6, Beacon(heading_rad=0.5))

A message on air is a 2-byte tag made from its class name and fields, then its fields packed little-endian. To the type
checker a field is a `float`, in the constructor and when read: a decoded field is widened to float64 from any width
on air, so that both kinds of agent compute with the same numbers.
"""

import struct
from collections.abc import Iterable, Iterator
from hashlib import blake2b
from typing import Annotated, Any, ClassVar, Self, cast, dataclass_transform, get_args, get_origin, get_type_hints

import msgpack
import numpy as np
from msgpack.exceptions import UnpackException

from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.base.ethernet import FRAME_TAG
from swarmwire.comms.robot.packets import TAG_BYTES, Payloads

f4 = Annotated[float, np.dtype("<f4")]  # float32 on air
f8 = Annotated[float, np.dtype("<f8")]  # float64 on air
i1 = Annotated[float, np.dtype("<i1")]  # int8 on air
i2 = Annotated[float, np.dtype("<i2")]  # int16 on air
i4 = Annotated[float, np.dtype("<i4")]  # int32 on air
u1 = Annotated[float, np.dtype("<u1")]  # uint8 on air
u2 = Annotated[float, np.dtype("<u2")]  # uint16 on air
u4 = Annotated[float, np.dtype("<u4")]  # uint32 on air

LETTERS = {"<f4": "f", "<f8": "d", "|i1": "b", "<i2": "h", "<i4": "i", "|u1": "B", "<u2": "H", "<u4": "I"}  # of struct
SEND_NAMES = ("rows", "to")  # arguments of a VectorAgent's `send`, beside which it takes the fields
DICT_TAG = 0  # a dict in msgpack, for prototypes; no class has this tag


@dataclass_transform(kw_only_default=True, frozen_default=True)
class Message:
    """The base class of messages; subclasses declare their fields with `f4`, `f8`, `i1` … `u4`.

    Raises TypeError where a class declares a field of another type or with a default, or an instance is made with a
    missing or unknown field or with anything but numbers; `encode` rounds to whole numbers where a field takes no
    others, and raises OverflowError where a number does not fit.
    """

    tag: ClassVar[int] = -1
    size_bytes: ClassVar[int] = TAG_BYTES
    on_air: ClassVar[np.dtype[Any]] = np.dtype([("tag", "<u2")])  # tag and fields, packed
    ranges: ClassVar[dict[str, tuple[float, float, bool]]] = {}  # of each field: lowest, highest, whole numbers only
    places: ClassVar[IntArray] = np.arange(TAG_BYTES)  # of the bytes
    packing: ClassVar[struct.Struct] = struct.Struct("<H")  # `on_air` once more, for one message at a time

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        fields: list[tuple[str, np.dtype[Any]]] = []
        for name, hint in get_type_hints(cls, include_extras=True).items():
            if get_origin(hint) is ClassVar:
                continue
            if hasattr(Message, name) or name in SEND_NAMES:
                raise TypeError(
                    f"{cls.__name__}.{name}: the name is taken by {'send' if name in SEND_NAMES else 'Message'}"
                )
            dtype: object = get_args(hint)[-1] if get_origin(hint) is Annotated else None
            if not isinstance(dtype, np.dtype):
                raise TypeError(f"{cls.__name__}.{name}: expected one of f4, f8, i1, i2, i4, u1, u2, u4")
            if name in vars(cls):
                raise TypeError(f"{cls.__name__}.{name}: a field has no default, every message says all of them")
            fields.append((name, cast("np.dtype[Any]", dtype)))
        cls.tag = _tag(cls.__name__, fields)
        cls.on_air = np.dtype([("tag", "<u2"), *fields])
        cls.size_bytes = cls.on_air.itemsize
        cls.places = np.arange(cls.size_bytes)
        cls.packing = struct.Struct("<H" + "".join(LETTERS[dtype.str] for _, dtype in fields))
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
            whole = [round(fields[name]) if whole else fields[name] for name, (_, _, whole) in self.ranges.items()]
            return self.packing.pack(self.tag, *whole)
        except (OverflowError, ValueError, struct.error):  # a number does not fit: `encode_rows` names the field
            return encode_rows(type(self), 1, dict(fields)).row(0)

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """The message of these bytes; ValueError if they are not of this class."""
        if len(payload) != cls.size_bytes or int.from_bytes(payload[:TAG_BYTES], "little") != cls.tag:
            raise ValueError(f"{len(payload)} bytes that are no {cls.__name__}")
        return cls.decode_at(payload, 0)

    @classmethod
    def decode_at(cls, data: bytes, start: int) -> Self:
        """The message whose bytes start there: its tag and their number must be this class's."""
        _, *numbers = cls.packing.unpack_from(data, start)
        message = object.__new__(cls)  # a class adds fields and nothing else: no need of __init__, which checks them
        message.__dict__.update(zip(cls.ranges, map(float, numbers), strict=True))
        return message


def message_classes(base: type[Message] = Message) -> Iterator[type[Message]]:
    """All message classes below `base` in this process."""
    for kind in base.__subclasses__():
        yield kind
        yield from message_classes(kind)


def message_class(kind: object) -> type[Message]:
    """The class of messages that this is; TypeError if it is something else, such as a message."""
    if not isinstance(kind, type) or not issubclass(kind, Message) or kind is Message:
        raise TypeError(f"expected a class of messages, got {kind!r}")
    return kind


def encode_rows(kind: type[Message], rows: int, fields: dict[str, Any]) -> Payloads:
    """`rows` messages of one class at once; each field is a number or an array (rows,)."""
    if fields.keys() != kind.ranges.keys():
        raise _wrong_fields(kind, fields)
    table = np.empty(rows, kind.on_air)
    table["tag"] = kind.tag
    for name, (lowest, highest, whole) in kind.ranges.items():
        values = np.asarray(fields[name], np.float64)
        if values.shape not in ((), (rows,)):
            raise ValueError(f"{kind.__name__}.{name}: expected one number or an array ({rows},), got {values.shape}")
        try:
            if whole:
                table[name] = _whole(values, lowest, highest)
            else:
                with np.errstate(over="raise"):
                    table[name] = values
        except (FloatingPointError, OverflowError):
            what = "whole numbers" if whole else "numbers"
            got = _misfit(np.rint(values) if whole else values, lowest, highest)
            expected = f"expected {what} from {lowest:.10g} to {highest:.10g}"
            raise OverflowError(f"{kind.__name__}.{name}: {expected}, got {got:.10g}") from None
    return Payloads(table.view(np.uint8), np.arange(rows + 1) * kind.size_bytes)


def decode_alike(kind: type[Message], payloads: Payloads, index: IntArray) -> dict[str, FloatArray] | None:
    """As `decode_rows`, but faster, for payloads that are all of this class; None if one is not."""
    if (payloads.sizes != kind.size_bytes).any():
        return None
    table = payloads.data.view(kind.on_air)
    if (table["tag"] != kind.tag).any():
        return None
    return {name: table[name].astype(np.float64).take(index) for name in kind.ranges}


def decode_rows(kind: type[Message], payloads: Payloads, index: IntArray) -> dict[str, FloatArray]:
    """The fields of payload rows `index`, which must all be of this class, each as float64 (len(index),)."""
    if not kind.ranges:
        return {}
    raw = payloads.data[payloads.offset[index, None] + kind.places]
    table = raw.view(kind.on_air)[:, 0]
    return {name: table[name].astype(np.float64) for name in kind.ranges}


def encode_dict(message: dict[str, Any]) -> bytes:
    """A dict on air: the dict tag, then msgpack; TypeError unless its keys are texts and msgpack takes its values."""
    payload = DICT_TAG.to_bytes(TAG_BYTES, "little") + msgpack.packb(message)
    read = dict_in(payload)  # the sender's error, not the receivers': a dict that cannot be decoded is refused here
    if read is None or not all(type(key) is str for key in read):
        raise TypeError(f"a dict message has texts as keys, got {list(message)}")
    return payload


def decode_dict(payload: bytes) -> dict[str, Any]:
    """The dict of these bytes; ValueError if they hold none."""
    try:
        message: object = msgpack.unpackb(payload[TAG_BYTES:], strict_map_key=False)
    except (TypeError, UnpackException) as error:  # a list as a key; all else is a ValueError
        raise ValueError(f"the payload holds no dict: {error}") from error
    if not isinstance(message, dict):
        raise ValueError("the payload holds no dict")
    return cast("dict[str, Any]", message)


def dict_in(payload: bytes) -> dict[str, Any] | None:
    """The dict in these bytes; None if they hold none, since the sender may run any code."""
    try:
        return decode_dict(payload)
    except ValueError:
        return None


def _wrong_fields(kind: type[Message], given: Iterable[str]) -> TypeError:
    names = kind.ranges or ("(none)",)
    return TypeError(f"{kind.__name__} has the fields {', '.join(names)}; got {', '.join(given) or 'none'}")


def _misfit(values: FloatArray, lowest: float, highest: float) -> float:
    return float(values[~((values >= lowest) & (values <= highest))].flat[0])


def _whole(values: FloatArray, lowest: float, highest: float) -> FloatArray:
    whole = np.rint(values)
    if not ((whole >= lowest) & (whole <= highest)).all():
        raise OverflowError
    return whole


def _range(dtype: np.dtype[Any]) -> tuple[float, float, bool]:
    whole = dtype.kind in "iu"
    span = np.iinfo(dtype) if whole else np.finfo(dtype)
    return float(span.min), float(span.max), whole


def _tag(name: str, fields: list[tuple[str, np.dtype[Any]]]) -> int:
    text = f"{name}({','.join(f'{field}:{dtype.str}' for field, dtype in fields)})"
    tag = 1 + int.from_bytes(blake2b(text.encode(), digest_size=2).digest(), "little") % 0xFFFF
    return tag + (tag == FRAME_TAG)
