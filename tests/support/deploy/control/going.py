"""A run that goes on in a thread of this process, paused before its first tick, and control over it as others have."""

import threading
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from swarmwire.deploy.config import Recording
from swarmwire.deploy.control.remote_control import RemoteControl, controlling
from swarmwire.deploy.live.following import Live, read_live
from swarmwire.deploy.simulation import Simulation, finished
from tests.support.deploy.commands import LOSSY
from tests.support.waiting import until


@contextmanager
def going(folder: Path, *overrides: str, **keys: Any) -> Generator[tuple[Simulation, RemoteControl]]:
    """The run and control over it; it goes to its end with the block."""
    keys = {"record": Recording(rrd=False, tables=False), **keys}
    simulation = Simulation(LOSSY, overrides=overrides, out=folder, **keys)
    simulation.controls.pause()
    thread = threading.Thread(target=finished, args=(simulation,))
    thread.start()
    try:
        live = until(lambda: read_live(folder))
        assert isinstance(live, Live)
        with controlling(live.endpoint, live.run) as control:
            at_tick(control, 0)
            yield simulation, control
    except BaseException:
        simulation.controls.quit()
        raise
    finally:
        if not simulation.controls.real_time:
            simulation.controls.set_speed(None)
        simulation.controls.resume()
        thread.join()


def at_tick(control: RemoteControl, tick: int) -> dict[str, Any]:
    """The status, once the run stands still there."""
    return until(control.status, lambda status: (status["state"], status["tick"]) == ("paused", tick))
