"""Observers of a live run in another process: its publications, as they arrive."""

# pyright: reportUnknownMemberType=false
# zenoh's stubs leave out the return types of put, reply and close.

from collections.abc import Generator
from contextlib import contextmanager

import numpy as np
import zenoh

from swarmwire.comms.base.arrays import FloatArray
from swarmwire.comms.base.errors import BadFrame, SwarmwireError
from swarmwire.comms.observe.run_views import MetricSeries, ObservedRun, ObservedTick
from swarmwire.comms.wire.frames import decode
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.observer_frames import decode_scene, decode_truth
from swarmwire.comms.wire.sessions import closed_after, open_observer
from swarmwire.deploy.runs.live_address import Live

MAX_WAITING = 8  # frames that wait for a slow viewer; older ones are dropped
ANSWER_TIMEOUT_S = 10.0  # limit for the constants of the run


class RunGone(SwarmwireError):
    """The run does not answer: it has ended or hangs."""


class RunSubscription:
    """A subscriber of a run: its scene, its ticks as they arrive, the values of its metrics, and its end."""

    def __init__(
        self, scene: ObservedRun, frames: "zenoh.Subscriber[Frames]", token: "zenoh.Subscriber[Frames]"
    ) -> None:
        self.scene = scene
        self.latest: dict[str, FloatArray] = {}
        self.lost = self.bad = 0  # frames that did not arrive, or could not be decoded
        self.over = False  # the run has ended, or its process is gone
        self._frames, self._token = frames, token
        self._serial: int | None = None
        self._gone = False

    @property
    def metrics(self) -> tuple[MetricSeries, ...]:
        """Metrics with values in `latest`."""
        return self.scene.series

    def next(self) -> ObservedTick | None:
        """Return the next tick, None if none has arrived; update `over`."""
        sample = self._frames.try_recv()
        if sample is None:
            self.over = self._gone  # after all earlier frames
            token = self._token.try_recv()
            self._gone = self._gone or (token is not None and token.kind == zenoh.SampleKind.DELETE)
            return None
        try:
            observed = decode_truth(decode(sample.payload.to_bytes()), self.scene)
        except BadFrame:
            self.bad += 1
            return None
        if self._serial is not None:
            self.lost += max(observed.serial - self._serial - 1, 0)
        self._serial = observed.serial
        self.latest = {series.name: row for series, row in zip(self.metrics, np.asarray(observed.values), strict=True)}
        return observed


Frames = zenoh.handlers.Handler[zenoh.Sample]


@contextmanager
def subscribe(live: Live, network: Network | None = None) -> Generator[RunSubscription]:
    """Subscribe to a run until the end of the block; RunGone if it does not answer.

    `network` has the certificates for an endpoint on another machine.
    """
    keys = ObserverKeys(live.run)
    try:
        session = open_observer(live.endpoint, network)
    except zenoh.ZError as error:
        raise RunGone(f"the run of process {live.pid} cannot be reached: {str(error).split(' at ')[0]}") from error
    with closed_after(session):
        token = session.liveliness().declare_subscriber(
            keys.published, zenoh.handlers.RingChannel(MAX_WAITING), history=True
        )
        # The run publishes nothing before it has a subscriber, so the scene comes first.
        scene = _scene(session, keys)
        frames = session.declare_subscriber(keys.truth, zenoh.handlers.RingChannel(MAX_WAITING))
        yield RunSubscription(scene, frames, token)


def _scene(session: zenoh.Session, keys: ObserverKeys) -> ObservedRun:
    for reply in session.get(keys.scene, timeout=ANSWER_TIMEOUT_S):
        if reply.ok is not None:
            return decode_scene(decode(reply.ok.payload.to_bytes()))
    raise RunGone("the run does not answer: it has ended, or has hung")
