"""Run a scenario to its end and give back what came of it."""

from collections.abc import Sequence
from pathlib import Path

from swarmwire.comms.interfaces import Observer
from swarmwire.deploy.arguments import Runners, SeedsGiven
from swarmwire.deploy.gateways.gateways import GatewaysGiven
from swarmwire.deploy.listening import Listening
from swarmwire.deploy.record.recording import Recording
from swarmwire.deploy.result import Result
from swarmwire.deploy.simulation import Simulation
from swarmwire.world.scenario.scenario import Scenario


def run(
    scenario: Scenario | Path | str,
    *,
    seed: int | None = None,
    seeds: SeedsGiven | None = None,
    runners: Runners = None,
    overrides: Sequence[str] = (),
    out: Path | str | None = None,
    observers: Sequence[Observer] = (),
    socket: Path | None = None,
    realtime: float | None = None,
    subtick: float | None = None,
    record: Recording | None = None,
    gateways: GatewaysGiven = None,
    listening: Listening | None = None,
) -> Result:
    """Run a scenario and return its result; with `seeds`, one arena per seed, side by side in one world.

    `seeds` are how many (9: 1 to 9), a list, or a text as for `--seeds`; one alone is `seed`. `runners` is None (all
    agents in this process), a number of runner processes, or "per-robot". `overrides` are "path=value" as for `--set`.
    With `out`, a new or empty folder, the run folder is written there; `record` says what goes into it. `realtime`
    keeps the run to the wall clock, so many simulated seconds per second, and waits for no runner; None runs as fast as
    the machine allows; with a `subtick`, 0.001 s or more of wall time, packets cross also between its ticks, when they
    are sent and due. `gateways` has robots answer as real ones, in real time, for programs elsewhere to drive: "epuck2"
    all of them, {"flock": "ros2"} those of a group; `Gateways` says also options, and the network of their agents.
    `listening` has the world wait for runners that others start, on this machine or elsewhere.

    Raises BadInput for anything wrong with the scenario or these arguments, AgentFailed with the agent's traceback, and
    RunnerLost if a runner's process or link is gone.
    """
    simulation = Simulation(
        scenario,
        seed=seed,
        seeds=seeds,
        runners=runners,
        overrides=overrides,
        out=out,
        observers=observers,
        socket=socket,
        realtime=realtime,
        subtick=subtick,
        record=record,
        gateways=gateways,
        listening=listening,
    )
    return finished(simulation)


def finished(simulation: Simulation) -> Result:
    """The result of a simulation that is run to its end here; Ctrl-C ends it after the tick under way."""
    with simulation.interrupt, simulation:
        simulation.run()
    return simulation.result
