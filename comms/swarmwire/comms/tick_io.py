"""The arrays that cross between world and agent backend in a tick: readings one way, actions the other.

`Readings` are what the robots' sensors read. `Actions` are the robots' drive commands, packets, notes, LED colours,
actuator commands and noted values. Notes and values are for observers: they change nothing in the run. Each of the
last four is a sparse table: a row for each robot that set something, none for the others.
"""

from dataclasses import dataclass, field

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import SentPackets

MAX_STATE = 64  # characters of a state
MAX_STATES = 256  # different states in a run, and in one tick of a runner


@dataclass(frozen=True, slots=True)
class Notes:
    """The states that robots named in one tick, such as `note(state="search")`: a row per robot."""

    rows: IntArray  # (k,) robot row: arena x robots + index, each once
    code: IntArray  # (k,) index in `names`
    names: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def none(cls) -> "Notes":
        """No notes."""
        return _NO_NOTES

    @classmethod
    def joined(cls, parts: "list[Notes]") -> "Notes":
        """The notes of all parts."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else cls.none()
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        code_of = {name: code for code, name in enumerate(names)}
        codes = [np.array([code_of[name] for name in part.names])[part.code] for part in parts]
        return cls(np.concatenate([part.rows for part in parts]), np.concatenate(codes), names)


_NO_NOTES = Notes(np.empty(0, np.int64), np.empty(0, np.int64))


def checked_state(state: object) -> str:
    """Return the state; ValueError unless it is a text of 1 to 64 characters."""
    if not isinstance(state, str) or not 0 < len(state) <= MAX_STATE:
        raise ValueError(f"note(state=…): expected a text of 1 to {MAX_STATE} characters, got {state!r}")
    return state


@dataclass(frozen=True, slots=True)
class LedChanges:
    """LED colours set in one tick, a row each; the last row of an LED counts, and other LEDs keep their colours."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    which: IntArray  # (k,) index of the LED in the body's spec
    rgb: IntArray  # (k,) 0xRRGGBB; 0: dark

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[LedChanges]") -> "LedChanges":
        """The changes of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_LED_CHANGES
        names = ("rows", "which", "rgb")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


NO_LED_CHANGES = LedChanges(*np.empty((3, 0), np.int64))


@dataclass(frozen=True, slots=True)
class ActuatorCommands:
    """Numbers set on custom actuators in one tick, a row each; the last row of a number counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    place: IntArray  # (k,) index among the numbers of all actuators of the body, in the order of its spec
    value: FloatArray  # (k,)

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[ActuatorCommands]") -> "ActuatorCommands":
        """The commands of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_ACTUATOR_COMMANDS
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.place for part in parts]),
            np.concatenate([part.value for part in parts]),
        )


NO_ACTUATOR_COMMANDS = ActuatorCommands(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers that robots noted in one tick, such as `note(value=1.25)`; the last row of a robot counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    value: FloatArray  # (k,) finite

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[Values]") -> "Values":
        """The values of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_VALUES
        return cls(np.concatenate([part.rows for part in parts]), np.concatenate([part.value for part in parts]))


NO_VALUES = Values(np.empty(0, np.int64), np.empty(0))


@dataclass(frozen=True, slots=True)
class GroupReadings:
    """The sensor readings of the robots of one group, a row per robot."""

    rows: IntArray  # (n,) robot row: arena x robots + index, rising
    fields: dict[str, FloatArray]  # "sensor.field" -> (n,) or (n, width), C-contiguous


Readings = dict[str, GroupReadings]  # by group


@dataclass(frozen=True, slots=True)
class Actions:
    """The actions of the robots whose agents stepped in one tick, a row per robot."""

    rows: IntArray  # (n,) robot row: arena x robots + index
    drive: BoolArray  # (n,) False: no command in this tick, the last one holds
    linear_mps: FloatArray  # (n,) commanded forward speed
    angular_radps: FloatArray  # (n,) commanded turn rate, positive to the left
    lateral_mps: FloatArray  # (n,) commanded speed to the left; 0 except for holonomic bodies
    sent: SentPackets = field(default_factory=SentPackets.none)
    notes: Notes = field(default_factory=Notes.none)
    leds: LedChanges = NO_LED_CHANGES
    own: ActuatorCommands = NO_ACTUATOR_COMMANDS  # of custom actuators
    values: Values = NO_VALUES

    @classmethod
    def joined(cls, parts: "list[Actions]") -> "Actions":
        """The actions of all parts."""
        if len(parts) == 1:
            return parts[0]
        if not parts:
            nothing = np.empty(0, np.int64)
            none = nothing.astype(float)
            return cls(nothing, nothing.astype(bool), none, none, none)
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.drive for part in parts]),
            np.concatenate([part.linear_mps for part in parts]),
            np.concatenate([part.angular_radps for part in parts]),
            np.concatenate([part.lateral_mps for part in parts]),
            SentPackets.joined([part.sent for part in parts]),
            Notes.joined([part.notes for part in parts]),
            LedChanges.joined([part.leds for part in parts]),
            ActuatorCommands.joined([part.own for part in parts]),
            Values.joined([part.values for part in parts]),
        )
