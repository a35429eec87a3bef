"""Actions by the name that a scenario's `do` gives. A new one is a file like `kill.py` and its line here.

What an action changes lies in `Conditions`: a new kind of effect is a new field there, read by world or, as part of
the `Disruption` that it makes, by the medium.
"""

from swarmwire.comms.events.event import Event
from swarmwire.comms.events.partition import Partition
from swarmwire.comms.events.radio_events import Blackout, Gain, Jammer, Ramp
from swarmwire.comms.events.robot_events import Fail, Impulse, Kill, Revive

# All that `do` may name.
ACTIONS: tuple[type[Event], ...] = (Kill, Revive, Fail, Blackout, Partition, Ramp, Gain, Jammer, Impulse)
