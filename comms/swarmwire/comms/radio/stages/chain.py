"""The chain: all steps that a packet passes on its way to a receiver, in order.

The unit disk passes its links through all of them. In a PHY, path loss, walls, interference and noise come before, in
its events; it takes the losses at the end of a frame, and passes received frames through `AFTER_RECEPTION`. So one
class serves both radio models.

To add a loss, a delay or a measurement:

1. Declare its scenario keys: a field of `Radio` (`config/radio.py`), None or without effect by default. A table of
   several keys is a frozen dataclass in `config/impairments.py`; `[radio.<name>]` follows from its field. These stand
   apart from their kernels, since a scenario is read without a compiler.
2. Write its file in `stages/`, with its `name`, the `keys` of [radio] that it uses, and `of(context)`, which returns
   None where this radio does not need it. A loss is a `LossModel` (`loss.py`, which ends with a short one) with a
   kernel for one frame. A delay or a measurement is a `Stage` with a compiled function over links (`delays.py`).
   Formulas, sources and units are in docstrings. Draws are keyed by the arena's key, (sender, receiver, sequence) as
   indices in the arena, and a purpose of its own, so that no step shifts the draws of another. A new drop reason is a
   new `Fate`; a column that later stages read is a new field of `Links`.
3. List the class: a loss in `LOSS_MODELS` (`losses.py`), others in `AFTER_RECEPTION` below, at its place.

A loss that depends on the link (`varies`) has a `delivery`, which the radio graph and the coverage of both models use.
"""

from swarmwire.comms.radio.stages.blocking import BodiesBlock, Disrupted, LineOfSight
from swarmwire.comms.radio.stages.delays import Latency, PropagationDelay, VaryingDelay
from swarmwire.comms.radio.stages.loss import LossModel
from swarmwire.comms.radio.stages.losses import LOSS_MODELS, LossStage, Reception
from swarmwire.comms.radio.stages.measurements import MeasuredBearing, MeasuredRange, MeasuredRssi
from swarmwire.comms.radio.stages.stage import ChannelContext, Stage
from swarmwire.comms.radio.stages.trace import TraceDelay

# Disruption is after propagation and before loss: a link that it ends was in range, and is not lost.
BEFORE_RECEPTION: tuple[type[Stage], ...] = (LineOfSight, BodiesBlock, Disrupted)
AFTER_RECEPTION: tuple[type[Stage], ...] = (
    TraceDelay,
    MeasuredRange,
    MeasuredBearing,
    MeasuredRssi,
    Latency,
    VaryingDelay,
    PropagationDelay,
)
ORDER: tuple[type[Stage | LossModel], ...] = (*BEFORE_RECEPTION, *LOSS_MODELS, *AFTER_RECEPTION)  # as users see it


def chain(context: ChannelContext) -> tuple[Stage, ...]:
    """The stages of a unit disk, in order."""
    stages = (kind.of(context) for kind in (*BEFORE_RECEPTION, LossStage, Reception, *AFTER_RECEPTION))
    return tuple(stage for stage in stages if stage is not None)


def chain_after_reception(context: ChannelContext) -> tuple[Stage, ...]:
    """The stages after reception, for a PHY."""
    stages = (kind.of(context) for kind in AFTER_RECEPTION)
    return tuple(stage for stage in stages if stage is not None)
