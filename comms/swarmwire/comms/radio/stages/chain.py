"""The chain: every stage that a packet passes on its way to a receiver, in order.

To add a stage:

1. Say what a scenario may give: a frozen dataclass in `parameters/<name>.py`, and a field `<name>` of `Radio`, None by
   default. The scenario's table `[radio.<name>]` follows from it. One number alone is just a field of `Radio`.
2. Write `stages/<name>.py` with the keys of [radio] that it goes by (`KEYS`), one small compiled function (formula,
   source and units in its docstring; arrays in, one array out), a `Stage` that applies it to the links, and
   `stage(context)`, which returns it, or None where this radio has none. Draws are keyed by the arena's key, (sender,
   receiver, sequence) as indices in the arena, and a purpose of its own, so that no stage shifts the draws of another.
   A new way to end a packet is a new `Fate`; a column that later stages read, a new field of `Links`.
3. List the module below, where it belongs: propagation, disruption (what it ends does not interfere either),
   interference, reception, bursts, trace, what the receiver learns, delay.

Radios with signals pass `AFTER_RECEPTION` alone: what stands there serves both kinds of radio. What comes before is one
with reception there: what weakens signals belongs to `signal/pairs.py`, what takes frames to `signal/losses.py`.
"""

from swarmwire.comms.radio.stages.blocking import BodiesBlock, Disrupted, LineOfSight
from swarmwire.comms.radio.stages.delays import Latency, PropagationDelay, VaryingDelay
from swarmwire.comms.radio.stages.losses import BurstLoss, FixedLoss, TraceReplay
from swarmwire.comms.radio.stages.measurements import MeasuredBearing, MeasuredRange, MeasuredRssi
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage

AFTER_RECEPTION: tuple[type[Stage], ...] = (
    TraceReplay,
    MeasuredRange,
    MeasuredBearing,
    MeasuredRssi,
    Latency,
    VaryingDelay,
    PropagationDelay,
)
ORDER: tuple[type[Stage], ...] = (
    LineOfSight,
    BodiesBlock,
    Disrupted,
    FixedLoss,
    BurstLoss,
    *AFTER_RECEPTION,
)  # order has a meaning


def chain(context: ChannelContext) -> tuple[Stage, ...]:
    """The stages that this medium has, in order."""
    made = (kind.of(context) for kind in ORDER)
    return tuple(stage for stage in made if stage is not None)


def chain_after_reception(context: ChannelContext) -> tuple[Stage, ...]:
    """Those of them that a signal passes once it was received: what comes before is one with its events."""
    made = (kind.of(context) for kind in AFTER_RECEPTION)
    return tuple(stage for stage in made if stage is not None)
