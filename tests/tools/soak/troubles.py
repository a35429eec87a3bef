"""Troubles of the processes of a soak: generators that act, and yield waits in s."""

import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import numpy as np
import psutil

from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from tests.tools.soak.processes import PYTHON, Steps, Supervised
from tests.tools.soak.site import Site

UNTOUCHED = 2  # runners, the first
PART = 0.1  # share of the runners that die at once, as with a machine


class Troubles:
    """Draws troubles and their targets.

    Attributes:
        tally: how often each happened.
        unanswered: orders that the run did not take, though it should have.
    """

    def __init__(self, site: Site, rng: np.random.Generator, note: Callable[..., None], timeout_s: float) -> None:
        """`timeout_s` is the timeout of runners."""
        self._site, self._rng, self._note, self._timeout_s = site, rng, note, timeout_s
        self.tally: dict[str, int] = {}
        self.unanswered: list[str] = []
        self.events = 0
        self._kinds: dict[Callable[[], Steps], float] = {
            self.runner_killed: 5,
            self.agent_killed: 4,
            self.many_killed: 1,
            self.runner_leaves: 2,
            self.runner_frozen: 3,
            self.runner_frozen_too_long: 1,
            self.runner_slowed: 2,
            self.world_frozen: 1,
            self.stranger_refused: 1,
            self.robots_killed: 2,
            self.loss_set: 2,
            self.parted: 1,
            self.pushed: 1,
            self.order_refused: 1,
            self.paused: 1,
        }
        if site.observers:
            self._kinds |= {
                self.observer_killed: 4,
                self.observer_frozen: 2,
            }

    def next(self) -> Steps:
        """A trouble, drawn."""
        weights = np.array(list(self._kinds.values()))
        kind = list(self._kinds)[int(self._rng.choice(len(weights), p=weights / weights.sum()))]
        self.tally[kind.__name__] = self.tally.get(kind.__name__, 0) + 1
        return kind()

    def runner_killed(self) -> Steps:
        """SIGKILL, and a restart after a while."""
        runner = self._runner()
        yield from self._gone("killed", runner, signal.SIGKILL)

    def agent_killed(self) -> Steps:
        """SIGKILL at one agent process; its host, which starts no other, is restarted for it."""
        runner = self._runner()
        agents = self._site.agents_of(runner)
        if agents:
            agent = agents[int(self._rng.integers(len(agents)))]
            self._note("agent killed", runner.name, agent.pid)
            with suppress(psutil.NoSuchProcess):
                agent.kill()
        yield 1.0
        yield from self._gone("leaves", runner, signal.SIGINT)

    def many_killed(self) -> Steps:
        """SIGKILL at a tenth of all runners at once, as if a machine was lost."""
        for runner in self._draw_runners(max(1, int(PART * len(self._site.runners)))):
            yield from self._gone("killed with others", runner, signal.SIGKILL)

    def runner_leaves(self) -> Steps:
        """Ctrl-C at a runner, which comes back."""
        yield from self._gone("leaves", self._runner(), signal.SIGINT)

    def runner_frozen(self) -> Steps:
        """SIGSTOP for less than the timeout."""
        yield from self._frozen(self._runner(), float(self._rng.uniform(0.1, 0.4 * self._timeout_s)))

    def runner_frozen_too_long(self) -> Steps:
        """SIGSTOP for longer than the timeout: the runner is lost, and joins again after it thaws."""
        yield from self._frozen(self._runner(), self._timeout_s + float(self._rng.uniform(1.0, 4.0)))

    def runner_slowed(self) -> Steps:
        """A third of its processor time for a while."""
        runner = self._runner()
        self._note("slowed", runner.name)
        for _ in range(20):
            if not runner.send(signal.SIGSTOP):
                return
            yield 0.2
            runner.send(signal.SIGCONT)
            yield 0.1

    def world_frozen(self) -> Steps:
        """SIGSTOP at the world, for a moment."""
        yield from self._frozen(self._site.world, float(self._rng.uniform(0.2, 2.0)))

    def observer_killed(self) -> Steps:
        """An observer, a page or a tab dies, and comes back."""
        process = self._observer()
        yield from self._gone("killed", process, signal.SIGKILL)

    def observer_frozen(self) -> Steps:
        """An observer, a page or a tab hangs for a while: it reads nothing of what it is sent."""
        yield from self._frozen(self._observer(), float(self._rng.uniform(1.0, 15.0)))

    def stranger_refused(self) -> Steps:
        """A runner of a new name requests taken robots, and is refused."""
        site, name = self._site, f"stranger-{self._rng.integers(10**9)}"
        command = (*PYTHON, "swarmwire.agent.cli", "join", site.endpoint or "", "--name", name, "--names", "swarm-0")
        stranger = Supervised(name, lambda: command, site.log("strangers"), site.env)
        stranger.tend(0)
        self._note("stranger", name)
        yield 30.0
        stranger.end()

    def robots_killed(self) -> Steps:
        """Robots die, and live again."""
        for_s = float(self._rng.uniform(2.0, 10.0))
        self._order({"do": "kill", "robots": {"group": "swarm", "share": 0.1}, "for_s": round(for_s, 1)})
        yield 0.0

    def loss_set(self) -> Steps:
        """The radio gets worse, or better, until it is undone."""
        number = self._order({"do": "ramp", "what": "radio.loss", "to": round(float(self._rng.uniform(0.0, 0.9)), 2)})
        yield float(self._rng.uniform(2.0, 20.0))
        self._ask("end", lambda run: run.end(number or 0), may_refuse=True)

    def parted(self) -> Steps:
        """One half does not hear the other."""
        self._order({"do": "partition", "halves": "x", "for_s": round(float(self._rng.uniform(2.0, 10.0)), 1)})
        yield 0.0

    def pushed(self) -> Steps:
        """Robots are pushed."""
        direction = round(float(self._rng.uniform(-3.0, 3.0)), 2)
        self._order({"do": "impulse", "robots": {"count": 5}, "speed_mps": 0.3, "direction_rad": direction})
        yield 0.0

    def order_refused(self) -> Steps:
        """An order that cannot be: it is refused, and changes nothing."""
        self._order({"do": "kill", "robots": {"group": "nobody", "share": 2.0}}, may_refuse=True)
        yield 0.0

    def paused(self) -> Steps:
        """The run stands still for a moment."""
        self._ask("pause", lambda run: run.pause())
        yield float(self._rng.uniform(0.2, 2.0))
        self._ask("resume", lambda run: run.resume())

    def _gone(self, how: str, process: Supervised, number: signal.Signals) -> Steps:
        process.after(float(self._rng.uniform(0.2, 3.0)))
        self._note(how, process.name)
        process.send(number)
        if process.frozen:
            process.send(signal.SIGCONT)
        yield 0.0

    def _frozen(self, process: Supervised, for_s: float) -> Steps:
        self._note("frozen", process.name, round(for_s, 2))
        if process.send(signal.SIGSTOP):
            yield for_s
            process.send(signal.SIGCONT)

    def _runner(self) -> Supervised:
        return self._draw_runners(1)[0]

    def _draw_runners(self, count: int) -> list[Supervised]:
        touched = self._site.runners[UNTOUCHED:]
        return [touched[int(i)] for i in self._rng.choice(len(touched), count, replace=False)]

    def _observer(self) -> Supervised:
        names = sorted(name for name in self._site.observers if not name.endswith("calm"))
        return self._site.observers[names[int(self._rng.integers(len(names)))]]

    def _order(self, table: Mapping[str, Any], *, may_refuse: bool = False) -> int | None:
        number = self._ask(f"order {table}", lambda run: run.event(table), may_refuse=may_refuse)
        self.events += number is not None
        return number

    def _ask(self, request: str, ask: Callable[[RemoteControl], Any], *, may_refuse: bool = False) -> Any:
        """The answer of the run, or None, which is noted as unanswered."""
        live = self._site.live
        if live is None or self._site.world.frozen:
            return None
        self._note(request, "world")
        try:
            with controlling(live.endpoint, live.run) as run:
                return ask(run)
        except SwarmwireError as error:
            if not may_refuse:
                self.unanswered.append(f"{request}: {error}")
                self._note("unanswered", "world", str(error))
            return None
