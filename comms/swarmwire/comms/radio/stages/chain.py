"""The chain: all stages that a packet passes on its way to a receiver, in order.

The unit disk passes its links through all stages. The events of a PHY compute path loss, walls, interference and
noise, and apply the losses at the end of a frame; received frames then pass through `AFTER_RECEPTION`. So one class
serves both radio models.

To add a loss, a delay or a measurement:

1. Declare its scenario keys: a field of `Radio` (`config/radio.py`), None or without effect by default. A table of
   several keys is a frozen dataclass in `config/impairments.py`; `[radio.<name>]` follows from its field. They are
   separate from the kernels, since a scenario is read without a compiler.
2. Write its file in `stages/`, with its `name`, the `keys` of [radio] that it uses, and `create(context)`, which
   returns None if this radio does not need it. A loss is a `FrameLoss` (`loss.py`, which ends with a short one) with a
   kernel for one frame. It sees a `ReceivedFrame`: robots, packet and time, but neither distance nor poses nor power; a
   loss that depends on distance is a path loss model, see below. A delay or a measurement is a `Stage` with a compiled
   function over links (`delays.py`). Docstrings state formulas, sources and units. Draws are keyed by the arena's key,
   (sender, receiver, sequence) as indices in the arena (`link_draws.py`), and a purpose of its own, so that no stage
   shifts the draws of another. A new drop reason is a new `Fate`, with its colour in `FATE_COLORS`
   (`metrics/drawing/canvas.py`) and, if every receiver has it on a link of its own, an entry in `LINK_FATES`
   (`metrics/run_folder/radio_totals.py`). A column that later stages read is a new field of `Links`.
3. List the class: a loss in `LOSS_MODELS` (`losses.py`), at the same position a field of `Losses`, which is built by
   position, and an index beside `FIXED_INDEX`, with its case in `_fate_by`; another stage in `AFTER_RECEPTION` below,
   in its position.

A loss that depends on the link (`varies`) has a `delivery`, which the radio graph and the coverage of both models use.

To add a path loss model, which a PHY applies before reception: a frozen dataclass in `config/path_loss_models.py` whose
`curve` returns a `LossCurve`; its name in `MODELS` and `MODEL_KEYS`, its field and its case in `path_loss_model`
(`config/radio.py`); its field in `PATH_LOSS` (`config/presets.py`); and a test of its formula in
`tests/unit/comms/radio/test_path_loss.py`. Compiled code stays as it is.
"""

from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.stages.blocking import BodiesBlock, Disrupted, LineOfSight
from swarmwire.comms.radio.stages.delays import Latency, PropagationDelay, VaryingDelay
from swarmwire.comms.radio.stages.loss import FrameLoss
from swarmwire.comms.radio.stages.losses import LOSS_MODELS, LossStage, ReceptionStage
from swarmwire.comms.radio.stages.measurements import MeasuredBearing, MeasuredRange, MeasuredRssi
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.radio.stages.trace import TraceDelay

# Disruption comes after propagation and before loss: a link that it ends was in range, and is not lost.
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
ORDER: tuple[type[Stage | FrameLoss], ...] = (
    *BEFORE_RECEPTION,
    *LOSS_MODELS,
    *AFTER_RECEPTION,
)  # the order that users see


def chain(context: ChannelContext) -> tuple[Stage, ...]:
    """Return the stages of a unit disk, in order."""
    stages = (kind.create(context) for kind in (*BEFORE_RECEPTION, LossStage, ReceptionStage, *AFTER_RECEPTION))
    return tuple(stage for stage in stages if stage is not None)


def chain_after_reception(context: ChannelContext) -> tuple[Stage, ...]:
    """Return the stages after reception, for a PHY."""
    stages = (kind.create(context) for kind in AFTER_RECEPTION)
    return tuple(stage for stage in stages if stage is not None)
