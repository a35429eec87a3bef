"""Troubles of a run, its runners and its observers: generators that act, and yield waits in s."""

import signal
from collections.abc import Callable, Mapping
from contextlib import suppress
from random import Random  # noqa: TID251 - Hypothesis draws by the same interface
from typing import Any

import psutil

from swarmwire.comms.base.errors import SwarmwireError
from swarmwire.deploy.live.remote_control import RemoteControl, controlling
from tests.tools.soak.processes import PYTHON, Steps, Supervised
from tests.tools.soak.site import Site, Target

PART = 0.1  # share of the runners that die at once, as with a machine

_RUNNER_FROZEN = {"runner_frozen": 3, "runner_frozen_too_long": 1, "runner_slowed": 2}
RUNNER_TROUBLES = {"runner_killed": 5, "agent_killed": 4, "many_killed": 1, "runner_leaves": 2, **_RUNNER_FROZEN}
_ORDERS = {"robots_killed": 2, "loss_set": 2, "parted": 1, "pushed": 1, "order_refused": 1}
WORLD_TROUBLES = {"world_frozen": 1, "paused": 1, "stranger_refused": 1, **_ORDERS}
OBSERVER_TROUBLES = {"observer_killed": 4, "observer_frozen": 2}
WEIGHTS = RUNNER_TROUBLES | WORLD_TROUBLES | OBSERVER_TROUBLES


class Troubles:
    """Troubles of one site. Each method is a trouble that draws its target and its durations.

    Attributes:
        tally: how often each happened.
        unanswered: orders that the run did not take, though it should have.
        events: live events that the run took.
    """

    def __init__(self, site: Site, note: Callable[..., None], timeout_s: float) -> None:
        """`timeout_s` is the timeout of runners."""
        self._site, self._note, self._timeout_s = site, note, timeout_s
        self.tally: dict[str, int] = {}
        self.unanswered: list[str] = []
        self.events = 0

    def drawn(self, draws: Random) -> Steps:
        """A trouble, drawn by its weight."""
        return self.named(draws.choices(list(WEIGHTS), list(WEIGHTS.values()))[0], draws)

    def named(self, name: str, draws: Random) -> Steps:
        """The trouble of this name."""
        self.tally[name] = self.tally.get(name, 0) + 1
        return getattr(self, name)(draws)

    def runner_killed(self, draws: Random) -> Steps:
        """SIGKILL, and a restart after a while."""
        return self._gone("killed", self._runner(draws), signal.SIGKILL, draws)

    def agent_killed(self, draws: Random) -> Steps:
        """SIGKILL at one agent process; its host, which starts no other, is restarted for it."""
        runner = self._runner(draws)
        agents = self._site.agents_of(runner)
        if agents:
            agent = draws.choice(agents)
            self._note("agent killed", runner.name, agent.pid)
            with suppress(psutil.NoSuchProcess):
                agent.kill()
        yield 1.0
        yield from self._gone("leaves", runner, signal.SIGINT, draws)

    def many_killed(self, draws: Random) -> Steps:
        """SIGKILL at a tenth of all runners at once, as if a machine was lost."""
        runners = self._site.disturbed
        for runner in draws.sample(runners, max(1, int(PART * len(runners)))):
            yield from self._gone("killed with others", runner, signal.SIGKILL, draws)

    def runner_leaves(self, draws: Random) -> Steps:
        """Ctrl-C at a runner, which comes back."""
        return self._gone("leaves", self._runner(draws), signal.SIGINT, draws)

    def runner_frozen(self, draws: Random) -> Steps:
        """SIGSTOP for less than the timeout."""
        return self._frozen(self._runner(draws), draws.uniform(0.1, 0.4 * self._timeout_s))

    def runner_frozen_too_long(self, draws: Random) -> Steps:
        """SIGSTOP for longer than the timeout: the runner is lost, and joins again after it thaws."""
        return self._frozen(self._runner(draws), self._timeout_s * draws.uniform(1.1, 1.5))

    def runner_slowed(self, draws: Random) -> Steps:
        """A third of its processor time for a while."""
        runner = self._runner(draws)
        self._note("slowed", runner.name)
        for _ in range(20):
            if not runner.send(signal.SIGSTOP):
                return
            yield 0.2
            runner.send(signal.SIGCONT)
            yield 0.1

    def router_killed(self, draws: Random) -> Steps:
        """SIGKILL at the router, if there is one, and a restart after a while."""
        if self._site.router:
            yield from self._gone("killed", self._site.router, signal.SIGKILL, draws)

    def router_frozen(self, draws: Random) -> Steps:
        """SIGSTOP at the router, if there is one, for less or longer than the timeout."""
        if self._site.router:
            yield from self._frozen(self._site.router, draws.uniform(0.1, 1.5 * self._timeout_s))

    def world_frozen(self, draws: Random) -> Steps:
        """SIGSTOP at the world, for a moment."""
        return self._frozen(self._site.world, draws.uniform(0.2, 2.0))

    def observer_killed(self, draws: Random) -> Steps:
        """An observer, a page or a tab dies, and comes back."""
        return self._gone("killed", self._observer(draws), signal.SIGKILL, draws)

    def observer_frozen(self, draws: Random) -> Steps:
        """An observer, a page or a tab hangs for a while: it reads nothing of what it is sent."""
        return self._frozen(self._observer(draws), self._timeout_s * draws.uniform(0.1, 2.0))

    def stranger_refused(self, draws: Random) -> Steps:
        """A runner of a new name requests taken robots, and is refused."""
        site, name = self._site, f"stranger-{draws.randrange(10**9)}"
        command = (*PYTHON, "swarmwire.agent.cli", "join", site.endpoint or "", "--name", name, "--names", "swarm-0")
        stranger = Supervised(name, lambda: command, site.log("strangers"), site.env)
        stranger.tend(0)
        self._note("stranger", name)
        for _ in range(30):
            if stranger.pid is None:
                break
            yield 1.0
        stranger.end()

    def robots_killed(self, draws: Random) -> Steps:
        """Robots die, and live again."""
        for_s = round(draws.uniform(2.0, 10.0), 1)
        self._order({"do": "kill", "robots": {"group": "swarm", "share": 0.1}, "for_s": for_s})
        yield 0.0

    def loss_set(self, draws: Random) -> Steps:
        """The radio gets worse, or better, until it is undone."""
        loss, for_s = round(draws.uniform(0.0, 0.9), 2), self._timeout_s * draws.uniform(0.25, 2.5)
        number = self._order({"do": "ramp", "what": "radio.loss", "to": loss})
        yield for_s
        self._ask("end", lambda run: run.end(number or 0), may_refuse=True)

    def parted(self, draws: Random) -> Steps:
        """One half does not hear the other."""
        self._order({"do": "partition", "halves": "x", "for_s": round(draws.uniform(2.0, 10.0), 1)})
        yield 0.0

    def pushed(self, draws: Random) -> Steps:
        """Robots are pushed."""
        direction = round(draws.uniform(-3.0, 3.0), 2)
        self._order({"do": "impulse", "robots": {"count": 5}, "speed_mps": 0.3, "direction_rad": direction})
        yield 0.0

    def order_refused(self, draws: Random) -> Steps:
        """An order that cannot be: it is refused, and changes nothing."""
        self._order({"do": "kill", "robots": {"group": "nobody", "share": 2.0}}, may_refuse=True)
        yield 0.0

    def paused(self, draws: Random) -> Steps:
        """The run stands still for a moment."""
        self._ask("pause", lambda run: run.pause())
        yield draws.uniform(0.2, 2.0)
        self._ask("resume", lambda run: run.resume())

    def _gone(self, how: str, process: Target, number: signal.Signals, draws: Random) -> Steps:
        process.after(draws.uniform(0.2, 3.0))
        self._note(how, process.name)
        process.send(number)
        if process.frozen:
            process.send(signal.SIGCONT)
        yield 0.0

    def _frozen(self, process: Target, for_s: float) -> Steps:
        self._note("frozen", process.name, round(for_s, 2))
        if process.send(signal.SIGSTOP):
            yield for_s
            process.send(signal.SIGCONT)

    def _runner(self, draws: Random) -> Target:
        return draws.choice(self._site.disturbed)

    def _observer(self, draws: Random) -> Supervised:
        names = sorted(name for name in self._site.observers if not name.endswith("calm"))
        return self._site.observers[draws.choice(names)]

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
