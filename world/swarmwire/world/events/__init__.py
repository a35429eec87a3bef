"""Events: the changes to robots and radios during a run that a scenario lists, each with an action.

A new action needs a class like `Kill`, and an entry in `ACTIONS`. Actions change `ActiveEffects`. A new kind of effect
is a new field there, which the world reads, or the radio medium as part of the `Disruption`.
"""

from swarmwire.world.events.event import Event
from swarmwire.world.events.partition import Partition
from swarmwire.world.events.radio_events import Blackout, Gain, Jammer, Ramp
from swarmwire.world.events.robot_events import Fail, Impulse, Kill, Revive

# The actions that `do` can name.
ACTIONS: tuple[type[Event], ...] = (Kill, Revive, Fail, Blackout, Partition, Ramp, Gain, Jammer, Impulse)
