"""The chain: all stages that a packet passes on its way to a receiver, in order.

To add a stage:

1. Declare its scenario keys: a frozen dataclass in `config/impairments.py`, and a field of `Radio`, None by default.
   The scenario's table `[radio.<name>]` follows from it. A single number is just a field of `Radio`.
2. Write a `Stage` in one of the modules of `stages/`, with its `name`, the `keys` of [radio] that it uses,
   `of(context)`, which returns None where this radio does not need it, and one small compiled function (formula, source
   and units in its docstring; arrays in, one array out). Draws are keyed by the arena's key, (sender, receiver,
   sequence) as indices in the arena, and a purpose of its own, so that no stage shifts the draws of another. A new drop
   reason is a new `Fate`; a column that later stages read is a new field of `Links`.
3. List the class below, at its place: propagation, disruption (a link that it ends does not interfere either),
   interference, reception, bursts, trace, measurements, delay.

A PHY uses `AFTER_RECEPTION` alone, so these stages serve both radio models. Earlier steps are part of its reception:
attenuation belongs to `phy/pairs.py`, a loss of frames to `phy/losses.py`.
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
)  # the order matters


def chain(context: ChannelContext) -> tuple[Stage, ...]:
    """The stages of this medium, in order."""
    stages = (kind.of(context) for kind in ORDER)
    return tuple(stage for stage in stages if stage is not None)


def chain_after_reception(context: ChannelContext) -> tuple[Stage, ...]:
    """The stages after reception, for a PHY, whose events cover the earlier ones."""
    stages = (kind.of(context) for kind in AFTER_RECEPTION)
    return tuple(stage for stage in stages if stage is not None)
