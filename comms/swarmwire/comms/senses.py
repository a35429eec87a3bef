"""What crosses between world and crew in a tick, as arrays: senses one way, commands and packets the other."""

from dataclasses import dataclass, field

import numpy as np

from swarmwire.comms.actuations import NO_ACTUATIONS, Actuations
from swarmwire.comms.arrays import BoolArray, FloatArray, IntArray
from swarmwire.comms.led_changes import NO_LED_CHANGES, LedChanges
from swarmwire.comms.notes import Notes
from swarmwire.comms.packets import Sent
from swarmwire.comms.values import NO_VALUES, Values


@dataclass(frozen=True, slots=True)
class GroupSenses:
    """The senses of the robots of one group, a row per robot."""

    rows: IntArray  # (n,) robot row: arena x robots + index, rising
    fields: dict[str, FloatArray]  # "sense.field" -> (n,) or (n, width), C-contiguous


Senses = dict[str, GroupSenses]  # by group


@dataclass(frozen=True, slots=True)
class Actions:
    """What the agents of some robots decided in one tick, a row per robot that decided."""

    rows: IntArray  # (n,) robot row: arena x robots + index
    drive: BoolArray  # (n,) False: no command in this tick, the last one holds
    linear_mps: FloatArray  # (n,) forward speed asked for
    angular_radps: FloatArray  # (n,) turn rate asked for, positive to the left
    lateral_mps: FloatArray  # (n,) speed to the left asked for; 0 but for holonomic bodies
    sent: Sent = field(default_factory=Sent.none)
    notes: Notes = field(default_factory=Notes.none)
    leds: LedChanges = NO_LED_CHANGES
    own: Actuations = NO_ACTUATIONS  # of actuators of the user's own
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
            Sent.joined([part.sent for part in parts]),
            Notes.joined([part.notes for part in parts]),
            LedChanges.joined([part.leds for part in parts]),
            Actuations.joined([part.own for part in parts]),
            Values.joined([part.values for part in parts]),
        )
