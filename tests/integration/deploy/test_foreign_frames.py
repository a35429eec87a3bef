"""Frames that are not what they should be are counted and named in the summary, and the run goes on, unchanged."""

import numpy as np
import zenoh

from swarmwire.comms.interfaces import Observer
from swarmwire.comms.truth import Truth
from swarmwire.comms.wire import frames
from swarmwire.comms.wire.keys import Keys
from swarmwire.comms.wire.sessions import open_runner, unix_endpoint
from swarmwire.deploy import run
from swarmwire.deploy.simulation import Simulation, finished
from tests.support.deploy.commands import LOSSY


class Vandal(Observer):
    """An observer that speaks to the agents' endpoint as a stranger would, in the middle of a run."""

    def __init__(self, path: str) -> None:
        self._path, self.keys = path, Keys("unknown")

    def see(self, truth: Truth) -> None:
        """Every kind of bad frame, once."""
        if truth.tick != 3:
            return
        with open_runner(unix_endpoint(self._path)) as session:
            answer = self.keys.answer("r0")
            rows = np.arange(7, dtype=np.int64)
            nothing = {"rows": rows, "command": np.zeros((4, 7))}
            for key, payload in (
                (answer, b"\x00garbage"),
                (answer, b""),
                (answer, b"\x00" * (frames.MAX_BYTES + 1)),
                (answer, frames.encode("dance", 4, {})),
                (answer, frames.encode("actions", 1, nothing)),
                (self.keys.answer("stranger"), frames.encode("actions", 4, {})),
                (self.keys.frame("r1"), b"\x00garbage"),
                (self.keys.frame("r1"), frames.encode("tick", 0, {})),
                ("swarmwire/*/answer/r0", frames.encode("failed", 4, {}, {"robots": "all", "traceback": "lies"})),
            ):
                session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)
            # The loop, in whose thread this runs, can only answer afterwards.
            list(session.get(self.keys.join("x"), payload=b"let me in", timeout=0.1))


def test_a_stranger_cannot_stop_or_change_a_run(tmp_path):
    path = tmp_path / "s"
    simulation = Simulation(LOSSY, overrides=["duration_s=2"], runners=3, socket=path)
    vandal = Vandal(str(path))
    vandal.keys = Keys(simulation.run_id)
    simulation.watch(vandal)
    result = finished(simulation)
    assert result.ticks == 20
    assert result.trajectory_sha256 == run(LOSSY, overrides=["duration_s=2"]).trajectory_sha256
    counts = result.counts
    assert counts["malformed_frames"] == 2
    assert counts["oversized_frames"] == 1
    assert counts["unexpected_kind_frames"] == 1
    assert counts["wrong_tick_frames"] == 1
    assert counts["unknown_runner_frames"] == 2
    assert counts["frames_dropped_by_runners"] == 2
    assert counts["bad_join"] == 1
