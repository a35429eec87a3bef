"""The log variables of an emulated Crazyflie, in blocks that a client subscribes to, and its parameters.

The parameters cover cflib's programs. Sources: crazyflie-firmware src/modules/src/log.c, crtp_log.md and
crtp_parameters.md in docs/functional-areas/crtp.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import isfinite
from struct import calcsize, error, pack, unpack
from typing import NamedTuple

from swarmwire.world.gateways.crazyflie.crtp import Errno, Toc

LOG_TYPES = {"B": 1, "H": 2, "I": 3, "b": 4, "h": 5, "i": 6, "f": 7, "e": 8}
LOG_KINDS = {code: kind for kind, code in LOG_TYPES.items()}
MAX_BLOCKS, MAX_VARIABLES, MAX_BLOCK_BYTES = 16, 128, 26
VARIABLES: dict[str, str] = (
    {f"stateEstimate.{name}": "f" for name in ("x", "y", "z", "vx", "vy", "vz", "roll", "pitch", "yaw")}
    | {f"stabilizer.{name}": "f" for name in ("roll", "pitch", "yaw", "thrust")}
    | {f"kalman.{name}": "f" for name in ("stateX", "stateY", "stateZ", "varPX", "varPY", "varPZ")}
    | {f"ctrltarget.{name}": "f" for name in ("x", "y", "z")}
    | {f"controller.{name}": "f" for name in ("roll", "pitch", "yaw")}
    | {f"range.{name}": "H" for name in ("front", "back", "left", "right", "up", "zrange")}
    | {f"acc.{axis}": "f" for axis in "xyz"}
    | {f"gyro.{axis}": "f" for axis in "xyz"}
    | {"pm.vbat": "f", "pm.batteryLevel": "B", "pm.state": "b"}
    | {"sys.canfly": "B", "sys.isFlying": "B", "sys.isTumbled": "B", "supervisor.info": "H"}
)


@dataclass
class Block:
    """Variables of one packet: their types as in `struct`, and their names."""

    kinds: list[str] = field(default_factory=list[str])
    names: list[str] = field(default_factory=list[str])
    period_ms: int = 0
    next_ms: int | None = None  # None: not started

    def is_due(self, now_ms: int) -> bool:
        """Return True if the block was started and is due."""
        return self.next_ms is not None and self.next_ms <= now_ms

    def encoded(self, values: Mapping[str, float]) -> bytes:
        """Encode the present values; an integer is clipped to its type's range, and nan becomes 0."""
        return b"".join(_encoded(kind, values[name]) for kind, name in zip(self.kinds, self.names, strict=True))


def _encoded(kind: str, value: float) -> bytes:
    if kind in "fe":
        return pack(f"<{kind}", value)
    bits = 8 * calcsize(kind)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind.islower() else (0, (1 << bits) - 1)
    return pack(f"<{kind}", min(max(round(value), low), high) if isfinite(value) else 0)


class Logs:
    """The blocks, and the answers to requests on the log port."""

    TABLE, CONTROL, DATA = range(3)
    DELETE, START, STOP, RESET, CREATE, APPEND, START_MS = 2, 3, 4, 5, 6, 7, 8

    def __init__(self) -> None:
        self._toc = Toc({name: LOG_TYPES[kind] for name, kind in VARIABLES.items()})
        self._blocks: dict[int, Block] = {}

    def answer(self, channel: int, data: bytes, now_ms: int) -> bytes | None:
        """Return the answer to a request; None: no answer."""
        if channel == self.TABLE:
            return self._toc.answer(data, bytes([MAX_BLOCKS, MAX_VARIABLES]))
        if channel != self.CONTROL or not data:
            return None
        if data[0] == self.RESET:
            self._blocks.clear()
            return bytes([self.RESET, 0, Errno.OK])
        return data[:2] + bytes([self._control(data[0], data[1], data[2:], now_ms)]) if len(data) > 1 else None

    def due(self, now_ms: int, values: Mapping[str, float], *, is_connected: bool) -> list[bytes]:
        """Return the data of the blocks that are due, at most once each; without a client, delete all blocks."""
        stamp = (now_ms & 0xFFFFFF).to_bytes(3, "little")
        if not is_connected and any(block.is_due(now_ms) for block in self._blocks.values()):
            self._blocks.clear()  # log.c: logRunBlock
        sent: list[bytes] = []
        for number, block in self._blocks.items():
            if block.is_due(now_ms):
                block.next_ms = max((block.next_ms or 0) + block.period_ms, now_ms + 1)
                sent.append(bytes([number]) + stamp + block.encoded(values))
        return sent

    def _control(self, command: int, number: int, data: bytes, now_ms: int) -> Errno:
        if command == self.CREATE:
            if number in self._blocks:
                return Errno.EEXIST
            if len(self._blocks) >= MAX_BLOCKS:
                return Errno.ENOMEM
            self._blocks[number] = Block()
            return self._append(self._blocks[number], data)
        block = self._blocks.get(number)
        if block is None:
            return Errno.ENOENT
        if command == self.APPEND:
            return self._append(block, data)
        if command in (self.START, self.START_MS):
            block.period_ms = int.from_bytes(data[:2], "little") if command == self.START_MS else 10 * sum(data[:1])
            block.next_ms = now_ms + block.period_ms
        elif command == self.STOP:
            block.next_ms = None
        elif command == self.DELETE:
            del self._blocks[number]
        else:
            return Errno.ENOEXEC
        return Errno.OK

    def _append(self, block: Block, data: bytes) -> Errno:
        """Add the variables, 3 bytes each; cflib may append the start of a variable that did not fit: skip it."""
        for offset in range(0, len(data) - 2, 3):
            kind, index = LOG_KINDS.get(data[offset] & 0x0F), int.from_bytes(data[offset + 1 : offset + 3], "little")
            if kind is None or index >= len(self._toc.names):
                return Errno.ENOENT
            if calcsize(f"<{''.join(block.kinds)}{kind}") > MAX_BLOCK_BYTES:
                return Errno.E2BIG
            if sum(len(other.names) for other in self._blocks.values()) >= MAX_VARIABLES:
                return Errno.ENOMEM
            block.kinds.append(kind)
            block.names.append(self._toc.names[index])
        return Errno.OK


PARAMETER_TYPES = {"B": 0x08, "H": 0x09, "I": 0x0A, "b": 0x00, "h": 0x01, "i": 0x02, "f": 0x06}
READ_ONLY = 0x40


class FirmwareParameter(NamedTuple):
    """A parameter: its type as in `struct`, and its default."""

    kind: str
    default: float
    writable: bool = True

    @property
    def code(self) -> int:
        """Type and flags in the table of contents."""
        return PARAMETER_TYPES[self.kind] | (0 if self.writable else READ_ONLY)


PARAMETERS: dict[str, FirmwareParameter] = {
    "kalman.resetEstimation": FirmwareParameter("B", 0),
    "kalman.initialX": FirmwareParameter("f", 0.0),
    "kalman.initialY": FirmwareParameter("f", 0.0),
    "kalman.initialZ": FirmwareParameter("f", 0.0),
    "kalman.initialYaw": FirmwareParameter("f", 0.0),
    "stabilizer.estimator": FirmwareParameter("B", 2),
    "stabilizer.controller": FirmwareParameter("B", 1),
    "stabilizer.stop": FirmwareParameter("B", 0),
    "commander.enHighLevel": FirmwareParameter("B", 1),
    "hlCommander.groupmask": FirmwareParameter("B", 0),
    "pid_attitude.pitch_kd": FirmwareParameter("f", 0.0),
    "pm.lowVoltage": FirmwareParameter("f", 3.2),
    "led.bitmask": FirmwareParameter("B", 0),
    "ring.effect": FirmwareParameter("B", 0),
    "ring.solidRed": FirmwareParameter("B", 20),
    "ring.solidGreen": FirmwareParameter("B", 20),
    "ring.solidBlue": FirmwareParameter("B", 20),
    "ring.headlightEnable": FirmwareParameter("B", 0),
    "ring.fadeColor": FirmwareParameter("I", 0),
    "ring.fadeTime": FirmwareParameter("f", 0.5),
    "cpu.flash": FirmwareParameter("H", 1024, writable=False),
    "deck.bcMultiranger": FirmwareParameter("B", 0, writable=False),
    "deck.bcFlow2": FirmwareParameter("B", 0, writable=False),
    "deck.bcZRanger2": FirmwareParameter("B", 0, writable=False),
    "deck.bcLedRing": FirmwareParameter("B", 0, writable=False),
    "deck.bcLighthouse4": FirmwareParameter("B", 0, writable=False),
}


class Parameters:
    """The values, and the answers to requests on the parameters' port."""

    TABLE, READ, WRITE, OTHER = range(4)
    SET_BY_NAME, DEFAULT, DEFAULT_V2 = 0, 6, 8

    def __init__(self, decks: dict[str, bool], written: Callable[[str], None]) -> None:
        """`decks` maps "deck.NAME" to True if the deck is mounted; `written` is called after a value was set."""
        self._toc = Toc({name: parameter.code for name, parameter in PARAMETERS.items()})
        self._values: dict[str, float] = {name: parameter.default for name, parameter in PARAMETERS.items()} | {
            name: int(is_mounted) for name, is_mounted in decks.items()
        }
        self._written = written

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __setitem__(self, name: str, value: float) -> None:
        self._values[name] = value

    def answer(self, channel: int, data: bytes) -> bytes | None:
        """Return the answer to a request; None: no answer."""
        if channel == self.TABLE:
            return self._toc.answer(data)
        if channel == self.OTHER:
            return self._answer_other(data)
        if len(data) < 2:
            return None
        name = self._name(data[:2])
        if name is None:
            return data[:2] + bytes([Errno.ENOENT])
        if channel == self.READ:
            return data[:2] + bytes([Errno.OK]) + self._encoded(name)
        self._set(name, data[2:])
        return data[:2] + self._encoded(name)

    def _answer_other(self, data: bytes) -> bytes | None:
        """Answer requests for values by name and defaults; no value is persistent."""
        if not data:
            return None
        if data[0] == self.SET_BY_NAME:
            group, short, value = (*data[1:].split(b"\0", 2), b"", b"")[:3]
            name = f"{group.decode('latin1')}.{short.decode('latin1')}"
            fits = name in PARAMETERS and value[:1] == bytes([PARAMETER_TYPES[PARAMETERS[name].kind]])
            result = self._set(name, value[1:]) if fits else Errno.ENOENT
            return b"\0" + group + b"\0" + short + b"\0" + bytes([result])
        name = self._name(data[1:3])
        if name is not None and data[0] in (self.DEFAULT, self.DEFAULT_V2):
            default = pack(f"<{PARAMETERS[name].kind}", PARAMETERS[name].default)
            return data[:3] + (bytes([Errno.OK]) if data[0] == self.DEFAULT_V2 else b"") + default
        return data[:3] + bytes([Errno.ENOENT])

    def _name(self, number: bytes) -> str | None:
        index = int.from_bytes(number, "little")
        return self._toc.names[index] if len(number) == 2 and index < len(self._toc.names) else None

    def _encoded(self, name: str) -> bytes:
        return pack(f"<{PARAMETERS[name].kind}", self._values[name])

    def _set(self, name: str, value: bytes) -> Errno:
        if not PARAMETERS[name].writable:
            return Errno.EACCES
        try:
            (self._values[name],) = unpack(f"<{PARAMETERS[name].kind}", value)
        except error:
            return Errno.EINVAL
        self._written(name)
        return Errno.OK
