"""Notes: the states that agents name for whoever looks on (`note(state="search")`). They change nothing in the run."""

from dataclasses import dataclass, field

import numpy as np

from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.packets import SentPackets

MAX_STATE = 64  # characters
MAX_STATES = 256  # different ones in a run; what a runner names in a tick is bounded by the same number


@dataclass(frozen=True, slots=True)
class Notes:
    """The states that some robots named in one tick, a row per robot that did."""

    rows: IntArray  # (k,) robot row: arena x robots + index, each once
    code: IntArray  # (k,) place in `names`
    names: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def none(cls) -> "Notes":
        """Nobody named a state."""
        return _NO_NOTES

    @classmethod
    def joined(cls, parts: "list[Notes]") -> "Notes":
        """The notes of all parts."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else cls.none()
        names = tuple(dict.fromkeys(name for part in parts for name in part.names))
        place = {name: code for code, name in enumerate(names)}
        codes = [np.array([place[name] for name in part.names])[part.code] for part in parts]
        return cls(np.concatenate([part.rows for part in parts]), np.concatenate(codes), names)


_NO_NOTES = Notes(np.empty(0, np.int64), np.empty(0, np.int64))


def checked_state(state: object) -> str:
    """The state; ValueError unless it is a text of 1 to 64 characters."""
    if not isinstance(state, str) or not 0 < len(state) <= MAX_STATE:
        raise ValueError(f"note(state=…): expected a text of 1 to {MAX_STATE} characters, got {state!r}")
    return state


# --- LEDs that agents switched in a tick; all others stay as they are.


@dataclass(frozen=True, slots=True)
class LedChanges:
    """The LEDs of some robots that got a colour in one tick, a row each; of two rows of an LED the later counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    which: IntArray  # (k,) place of the LED in the body's sheet
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


NO_LED_CHANGES = LedChanges(*np.empty((3, 0), np.int64))  # nobody switches any


# --- What agents set actuators of the user's own to in a tick; all others are not set anew.


@dataclass(frozen=True, slots=True)
class ActuatorCommands:
    """The numbers that some robots set in one tick, a row each; of two rows of a place the later counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    place: IntArray  # (k,) among the numbers of all actuators of the body, in the order of its sheet
    value: FloatArray  # (k,)

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[ActuatorCommands]") -> "ActuatorCommands":
        """Those of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_ACTUATOR_COMMANDS
        return cls(
            np.concatenate([part.rows for part in parts]),
            np.concatenate([part.place for part in parts]),
            np.concatenate([part.value for part in parts]),
        )


NO_ACTUATOR_COMMANDS = ActuatorCommands(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0))  # nobody acts


# --- Values: the numbers that agents tell whoever looks on (`note(value=1.25)`). They change nothing in the run.


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers that some robots told in one tick, a row each; of two rows of a robot the later counts."""

    rows: IntArray  # (k,) robot row: arena x robots + index
    value: FloatArray  # (k,) finite

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def joined(cls, parts: "list[Values]") -> "Values":
        """Those of all parts, in order."""
        parts = [part for part in parts if len(part)]
        if len(parts) < 2:
            return parts[0] if parts else NO_VALUES
        return cls(np.concatenate([part.rows for part in parts]), np.concatenate([part.value for part in parts]))


NO_VALUES = Values(np.empty(0, np.int64), np.empty(0))  # nobody tells any


# --- What crosses between world and backend in a tick, as arrays: senses one way, commands and packets the other.


@dataclass(frozen=True, slots=True)
class GroupReadings:
    """The senses of the robots of one group, a row per robot."""

    rows: IntArray  # (n,) robot row: arena x robots + index, rising
    fields: dict[str, FloatArray]  # "sense.field" -> (n,) or (n, width), C-contiguous


Readings = dict[str, GroupReadings]  # by group


@dataclass(frozen=True, slots=True)
class Actions:
    """What the agents of some robots decided in one tick, a row per robot that decided."""

    rows: IntArray  # (n,) robot row: arena x robots + index
    drive: BoolArray  # (n,) False: no command in this tick, the last one holds
    linear_mps: FloatArray  # (n,) forward speed asked for
    angular_radps: FloatArray  # (n,) turn rate asked for, positive to the left
    lateral_mps: FloatArray  # (n,) speed to the left asked for; 0 but for holonomic bodies
    sent: SentPackets = field(default_factory=SentPackets.none)
    notes: Notes = field(default_factory=Notes.none)
    leds: LedChanges = NO_LED_CHANGES
    own: ActuatorCommands = NO_ACTUATOR_COMMANDS  # of actuators of the user's own
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
