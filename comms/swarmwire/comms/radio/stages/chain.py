"""The chain: all stages that a packet passes on its way to a receiver, in order.

A stage is a compiled function of one link. `fate_before_reception` and `after_reception` call them in their order. The
unit disk calls both for each link when a packet goes on air. The events of a PHY compute path loss, walls, interference
and noise, and apply the losses at the end of a frame; received frames then pass `after_reception`. So a stage is
written once for both radio models.

To add a loss, a delay or a measurement:

1. Declare its scenario keys: a field of `Radio` (`config/radio.py`), None or without effect by default. A table of
   several keys is a frozen dataclass in `config/impairments.py`; `[radio.<name>]` follows from its field. They are
   separate from the kernels, since a scenario is read without a compiler.
2. Write its file in `stages/`: a class with its `name`, the `keys` of [radio] that it uses, and `create(context)`,
   which returns None if this radio does not need it; the FIELDS of its parameters; and a kernel. A loss is a
   `FrameLoss` (`loss.py`, which ends with a short one) with a kernel for one frame. It sees a `ReceivedFrame`: robots,
   packet and time, but neither distance nor poses nor power; a loss that depends on distance is a path loss model
   (CONTRIBUTING.md). A delay or a measurement is a `Stage` with a kernel that returns the delay or the value
   (`delays.py`). Docstrings state formulas, sources and units. Draws are keyed by the arena's key, (sender, receiver,
   sequence) as indices in the arena (`link_draws.py`), and a purpose of its own, so that no stage shifts the draws of
   another. A new drop reason is a new `Fate`, with its colour in `FATE_COLORS` (`metrics/pictures/drawing/canvas.py`)
   and, if every receiver has it on a link of its own, an entry in `LINK_FATES`
   (`metrics/records/run_folder/radio_totals.py`). A new measurement is a field of LINK (`links.py`), listed in
   `Measures.columns`.
3. List the class, and call the kernel: a loss in `LOSS_MODELS` and `loss_fate` (`losses.py`), another stage in
   `AFTER_RECEPTION` and `after_reception` below, in its position.

A loss that depends on the link (`varies`) has a `delivery`, which the radio graph and the coverage of both models use.
"""

from typing import Any, NamedTuple

import numpy as np

from swarmwire.comms.base.arrays import Table, record_type
from swarmwire.comms.base.kernels import kernel
from swarmwire.comms.base.sentinels import UNDER_WAY
from swarmwire.comms.radio.context import ChannelContext
from swarmwire.comms.radio.propagation.obstruction import BodyParams
from swarmwire.comms.radio.stages.blocking import (
    BodiesBlock,
    Disrupted,
    LineOfSight,
    SightParams,
    disrupted_fate,
    is_behind_bodies,
    is_out_of_sight,
)
from swarmwire.comms.radio.stages.delays import (
    Latency,
    PropagationDelay,
    VaryingDelay,
    frame_delay_ns,
    latency_ns,
    propagation_delay_ns,
)
from swarmwire.comms.radio.stages.loss import FrameLoss
from swarmwire.comms.radio.stages.losses import LOSS_MODELS, Losses, loss_fate, stateless_loss_fate
from swarmwire.comms.radio.stages.measurements import (
    MeasuredBearing,
    MeasuredRange,
    MeasuredRssi,
    measured_bearing_rad,
    measured_range_m,
    measured_rssi_dbm,
    to_sender_m,
)
from swarmwire.comms.radio.stages.stage import Stage
from swarmwire.comms.radio.stages.trace import TraceDelay, trace_delay_ns
from swarmwire.comms.robot.packets import Fate

BLOCKED = int(Fate.BLOCKED)
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
PARAMS = record_type(
    [
        *((kind.name, record_type(kind.FIELDS)) for kind in AFTER_RECEPTION if kind.FIELDS),
        ("wrap_x_m", np.float64),  # sides of a torus; 0 in arenas with walls
        ("wrap_y_m", np.float64),
        ("needs_distance", np.bool_),
        ("has_any", np.bool_),
    ]
)


class StagesBefore(NamedTuple):
    """Parameters of the stages before reception, in a unit disk; None: the radio lacks the stage."""

    sight: SightParams | None
    bodies: BodyParams | None
    losses: Losses


def stages_after(context: ChannelContext) -> Table:
    """Return the parameters of the stages after reception of this medium: one record of type PARAMS."""
    stages = [stage for kind in AFTER_RECEPTION if (stage := kind.create(context)) is not None]
    params: Table = np.zeros(1, PARAMS)
    record = params[0]
    record.has_any = bool(stages)
    record.wrap_x_m, record.wrap_y_m = context.wrap_m
    record.needs_distance = any(
        isinstance(stage, MeasuredRange | MeasuredBearing | PropagationDelay) for stage in stages
    )
    for stage in stages:
        stage.write(record[stage.name])
    return params


@kernel()
def fate_before_reception(stages: Any, cuts: Any, pose: Any, frame: Any, goes_on_air: bool):
    """Return the fate of a frame before it is received: UNDER_WAY if nothing ends it."""
    if is_out_of_sight(stages.sight, pose, frame.sender, frame.receiver):
        return BLOCKED
    if is_behind_bodies(stages.bodies, frame.sender, frame.receiver):
        return BLOCKED
    fate = disrupted_fate(cuts, frame.sender, frame.receiver)
    if fate != UNDER_WAY:
        return fate
    return loss_fate(stages.losses, frame) if goes_on_air else stateless_loss_fate(stages.losses, frame)


@kernel()
def after_reception(stages: Any, measured: Any, pose: Any, frame: Any, link: Any):
    """Measure and delay a link that was received, by `stages_after` and `LinkTraces.values`; in place."""
    params, dx, dy, distance_m = stages[0], 0.0, 0.0, 0.0
    if params.needs_distance:
        dx, dy, dz = to_sender_m(pose, frame.sender, frame.receiver, params.wrap_x_m, params.wrap_y_m)
        distance_m = np.sqrt(dx * dx + dy * dy + dz * dz)
    delay_ns = trace_delay_ns(params.trace_delay, measured, frame, link.final_at_ns)
    if params.measured_range.is_used:
        link.range_m = measured_range_m(params.measured_range, distance_m, frame)
    if params.measured_bearing.is_used:
        link.bearing_rad = measured_bearing_rad(params.measured_bearing, dx, dy, pose[frame.receiver, 2], frame)
    if params.measured_rssi.is_used:
        link.measured_rssi_dbm = measured_rssi_dbm(params.measured_rssi, link.rssi_dbm, frame)
    delay_ns += latency_ns(params.latency, frame)
    delay_ns += frame_delay_ns(params.varying_delay, frame)
    delay_ns += propagation_delay_ns(params.propagation_delay, distance_m)
    link.final_at_ns += delay_ns
