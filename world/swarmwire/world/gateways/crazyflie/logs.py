"""The log variables of an emulated Crazyflie, and the blocks of them that a client has sent to itself.

Source: crazyflie-firmware docs/functional-areas/crtp/crtp_log.md, src/modules/src/log.c.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite
from struct import calcsize, pack

from swarmwire.world.gateways.crazyflie.crtp import Errno, Toc

TYPES = {"B": 1, "H": 2, "I": 3, "b": 4, "h": 5, "i": 6, "f": 7, "e": 8}
KINDS = {code: kind for kind, code in TYPES.items()}
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
    """Variables that go out together: their types as in `struct`, and their names."""

    kinds: list[str] = field(default_factory=list[str])
    names: list[str] = field(default_factory=list[str])
    period_ms: int = 0
    next_ms: int | None = None  # None: not started

    def encoded(self, values: Mapping[str, float]) -> bytes:
        """The values now; an integer is clipped to its type's range, and what is not a number is 0."""
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
        self._toc = Toc({name: TYPES[kind] for name, kind in VARIABLES.items()})
        self._blocks: dict[int, Block] = {}

    def answer(self, channel: int, data: bytes, now_ms: int) -> bytes | None:
        """The answer to a request; None: there is none."""
        if channel == self.TABLE:
            return self._toc.answer(data, bytes([MAX_BLOCKS, MAX_VARIABLES]))
        if channel != self.CONTROL or not data:
            return None
        if data[0] == self.RESET:
            self._blocks.clear()
            return bytes([self.RESET, 0, Errno.OK])
        return data[:2] + bytes([self._control(data[0], data[1], data[2:], now_ms)]) if len(data) > 1 else None

    def due(self, now_ms: int, values: Mapping[str, float]) -> list[bytes]:
        """The data of the blocks whose time has come, at most once each."""
        stamp = (now_ms & 0xFFFFFF).to_bytes(3, "little")
        sent: list[bytes] = []
        for number, block in self._blocks.items():
            if block.next_ms is not None and block.next_ms <= now_ms:
                block.next_ms = max(block.next_ms + block.period_ms, now_ms + 1)
                sent.append(bytes([number]) + stamp + block.encoded(values))
        return sent

    def _control(self, command: int, number: int, rest: bytes, now_ms: int) -> Errno:
        if command == self.CREATE:
            if number in self._blocks:
                return Errno.EEXIST
            if len(self._blocks) >= MAX_BLOCKS:
                return Errno.ENOMEM
            self._blocks[number] = Block()
            return self._append(self._blocks[number], rest)
        block = self._blocks.get(number)
        if block is None:
            return Errno.ENOENT
        if command == self.APPEND:
            return self._append(block, rest)
        if command in (self.START, self.START_MS):
            block.period_ms = int.from_bytes(rest[:2], "little") if command == self.START_MS else 10 * sum(rest[:1])
            block.next_ms = now_ms + block.period_ms
        elif command == self.STOP:
            block.next_ms = None
        elif command == self.DELETE:
            del self._blocks[number]
        else:
            return Errno.ENOEXEC
        return Errno.OK

    def _append(self, block: Block, rest: bytes) -> Errno:
        """Add the variables, 3 bytes each; cflib begins one that no longer fits, which is passed over."""
        for at in range(0, len(rest) - 2, 3):
            kind, index = KINDS.get(rest[at] & 0x0F), int.from_bytes(rest[at + 1 : at + 3], "little")
            if kind is None or index >= len(self._toc.names):
                return Errno.ENOENT
            if calcsize(f"<{''.join(block.kinds)}{kind}") > MAX_BLOCK_BYTES:
                return Errno.E2BIG
            if sum(len(of.names) for of in self._blocks.values()) >= MAX_VARIABLES:
                return Errno.ENOMEM
            block.kinds.append(kind)
            block.names.append(self._toc.names[index])
        return Errno.OK
