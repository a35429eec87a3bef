"""The parameters of an emulated Crazyflie: those that cflib's programs use, with their types and values.

Source: crazyflie-firmware docs/functional-areas/crtp/crtp_parameters.md.
"""

from collections.abc import Callable
from struct import error, pack, unpack
from typing import NamedTuple

from swarmwire.world.gateways.crazyflie.crtp import Errno, Toc

TYPES = {"B": 0x08, "H": 0x09, "I": 0x0A, "b": 0x00, "h": 0x01, "i": 0x02, "f": 0x06}
READ_ONLY = 0x40


class Parameter(NamedTuple):
    """Its type as in `struct`, and its value at the start."""

    kind: str
    default: float
    writable: bool = True


PARAMETERS: dict[str, Parameter] = {
    "kalman.resetEstimation": Parameter("B", 0),
    "kalman.initialX": Parameter("f", 0.0),
    "kalman.initialY": Parameter("f", 0.0),
    "kalman.initialZ": Parameter("f", 0.0),
    "kalman.initialYaw": Parameter("f", 0.0),
    "stabilizer.estimator": Parameter("B", 2),
    "stabilizer.controller": Parameter("B", 1),
    "stabilizer.stop": Parameter("B", 0),
    "commander.enHighLevel": Parameter("B", 1),
    "hlCommander.groupmask": Parameter("B", 0),
    "pid_attitude.pitch_kd": Parameter("f", 0.0),
    "pm.lowVoltage": Parameter("f", 3.2),
    "led.bitmask": Parameter("B", 0),
    "ring.effect": Parameter("B", 0),
    "ring.solidRed": Parameter("B", 20),
    "ring.solidGreen": Parameter("B", 20),
    "ring.solidBlue": Parameter("B", 20),
    "ring.headlightEnable": Parameter("B", 0),
    "ring.fadeColor": Parameter("I", 0),
    "ring.fadeTime": Parameter("f", 0.5),
    "cpu.flash": Parameter("H", 1024, writable=False),
    "deck.bcMultiranger": Parameter("B", 0, writable=False),
    "deck.bcFlow2": Parameter("B", 0, writable=False),
    "deck.bcZRanger2": Parameter("B", 0, writable=False),
    "deck.bcLedRing": Parameter("B", 0, writable=False),
    "deck.bcLighthouse4": Parameter("B", 0, writable=False),
}


class Parameters:
    """The values, and the answers to requests on the parameters' port."""

    TABLE, READ, WRITE, OTHER = range(4)
    SET_BY_NAME, EXTENDED_TYPE, DEFAULT, DEFAULT_V2 = 0, 2, 6, 8

    def __init__(self, decks: dict[str, bool], written: Callable[[str], None]) -> None:
        """`decks` are there or not, by "deck.NAME"; `written` is called after a value was set."""
        self._toc = Toc({name: TYPES[of.kind] | (0 if of.writable else READ_ONLY) for name, of in PARAMETERS.items()})
        self._values: dict[str, float] = {name: of.default for name, of in PARAMETERS.items()} | {
            name: int(there) for name, there in decks.items()
        }
        self._written = written

    def __getitem__(self, name: str) -> float:
        return self._values[name]

    def __setitem__(self, name: str, value: float) -> None:
        self._values[name] = value

    def answer(self, channel: int, data: bytes) -> bytes | None:
        """The answer to a request; None: there is none."""
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
        """Values by name and defaults; nothing is persistent."""
        if not data:
            return None
        if data[0] == self.SET_BY_NAME:
            group, _, rest = data[1:].partition(b"\0")
            short, _, value = rest.partition(b"\0")
            name = f"{group.decode('latin1')}.{short.decode('latin1')}"
            fits = name in PARAMETERS and value[:1] == bytes([TYPES[PARAMETERS[name].kind]])
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
