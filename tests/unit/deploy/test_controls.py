"""What people ask of a run holds it up or ends it, at once, and never changes what it does."""

import signal
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import pytest
import typer

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.base.errors import Interrupted
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Truth
from swarmwire.deploy import Result, run
from swarmwire.deploy.cli.options import leaving_when_hung_up
from swarmwire.deploy.runs import simulation as simulation_module
from swarmwire.deploy.runs.controls import POLL_NS, Controls, Interrupt
from swarmwire.deploy.runs.simulation import Simulation, run_to_end
from swarmwire.world.backends.pacing import Pace
from tests.support.clocks import MS, FakeClock, GoingClock
from tests.support.deploy.runs import LOSSY
from tests.support.refusals import refused_input

RATE_HZ = 10
TICK_NS = NS_PER_S // RATE_HZ


class Asking:
    """A clock on which people ask for things at set times."""

    def __init__(self, clock: FakeClock, controls: Controls) -> None:
        self.clock = clock
        self.asks: list[tuple[int, Callable[[], object]]] = []
        controls.on_wait = self.look

    def at_ms(self, ms: int, ask: Callable[[], object]) -> None:
        self.asks.append((self.clock.time_ns + ms * MS, ask))

    def look(self) -> None:
        while self.asks and self.clock.time_ns >= self.asks[0][0]:
            self.asks.pop(0)[1]()


def controlled(factor: float | None = None) -> tuple[FakeClock, Controls, Asking, Pace | None]:
    clock = FakeClock()
    pace = None if factor is None else Pace(clock, RATE_HZ, factor, lambda _: None)
    controls = Controls(clock, RATE_HZ, pace)
    return clock, controls, Asking(clock, controls), pace


def never() -> bool:
    return False


def test_run_without_requests_is_not_held() -> None:
    clock, controls, _, _ = controlled()
    controls.wait(0, never)
    clock.now_ns = lambda: pytest.fail("it reads the clock, in every tick")
    for tick in range(1, 5):
        controls.wait(tick, lambda: pytest.fail("it asks, in every tick"))
    assert not clock.slept_until


def test_pause_lasts_until_resume() -> None:
    clock, controls, asking, _ = controlled()
    controls.wait(0, never)
    controls.pause()
    began_ns = clock.time_ns
    asking.at_ms(5000, controls.resume)
    controls.wait(1, never)
    assert 5000 * MS <= clock.time_ns - began_ns <= 5000 * MS + 2 * POLL_NS
    assert controls.paused_ns == clock.time_ns - began_ns
    sleeps = len(clock.slept_until)
    controls.wait(2, never)
    assert len(clock.slept_until) == sleeps


@pytest.mark.parametrize("ask", ["quit", "interrupt"])
def test_pause_ends_on_quit_or_interrupt(ask: str) -> None:
    _, controls, asking, _ = controlled()
    interrupted: list[bool] = []
    controls.pause()
    asking.at_ms(300, controls.quit if ask == "quit" else lambda: interrupted.append(True))
    controls.wait(0, lambda: bool(interrupted))
    assert controls.quit_requested == (ask == "quit")


def test_speed_limit_is_kept_until_it_is_lifted() -> None:
    clock, controls, _, _ = controlled()
    controls.wait(0, never)
    clock.time_ns += 10 * TICK_NS // 4  # ten ticks at 4 x real time
    controls.wait(10, never)
    controls.set_speed(2.0)
    began_ns = []
    for tick in range(11, 21):
        controls.wait(tick, never)
        began_ns.append(clock.time_ns)
        clock.time_ns += 7 * MS
    gaps = [after - before for before, after in pairwise(began_ns)]
    assert gaps == [TICK_NS // 2] * 9
    controls.set_speed(None)
    sleeps = len(clock.slept_until)
    controls.wait(21, never)
    controls.wait(22, never)
    assert len(clock.slept_until) == sleeps


def test_speed_limit_does_not_hold_a_slow_run_or_let_it_rush_later() -> None:
    clock, controls, _, _ = controlled()
    controls.speed = 1.0
    for tick in range(4):
        controls.wait(tick, never)
        clock.time_ns += 3 * TICK_NS
    assert not clock.slept_until
    began_ns = []
    for tick in range(4, 9):
        controls.wait(tick, never)
        began_ns.append(clock.time_ns)
    assert began_ns[-1] - began_ns[0] >= 3 * TICK_NS


def test_real_time_factor_changes_from_the_next_tick_on() -> None:
    clock, controls, _, pace = controlled(1.0)
    ends_ns = []
    for tick in range(4):
        if tick == 2:
            controls.set_speed(2.0)
        controls.wait(tick, never)
        pace.begin()
        pace.wait(tick)
        ends_ns.append(clock.time_ns - 77)
    assert ends_ns == [TICK_NS, 2 * TICK_NS, 2 * TICK_NS + TICK_NS // 2, 3 * TICK_NS]
    assert pace.factor == controls.speed == 2.0


def test_real_time_run_misses_no_tick_in_a_pause() -> None:
    clock, controls, asking, pace = controlled(1.0)
    asked_ns = []
    for tick in range(4):
        if tick == 2:
            controls.pause()
            asking.at_ms(60_000, controls.resume)
        controls.wait(tick, never)
        asked_ns.append(pace.begin() - 77)
        pace.wait(tick)
    assert asked_ns == [tick * TICK_NS for tick in range(4)]  # as if there had been no pause
    assert clock.time_ns - 77 == 4 * TICK_NS + controls.paused_ns
    assert (controls.missed_ticks, pace.worst_lag_ns) == (0, 0)


SHORT = ["duration_s=3"]


@pytest.fixture(scope="module")
def free() -> Result:
    return run(LOSSY, overrides=SHORT)


def test_run_is_equal_with_pauses_steps_and_speed_limits(free: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_module, "WallClock", lambda: GoingClock(MS))
    simulation = Simulation(LOSSY, overrides=SHORT)
    controls = simulation.controls
    pause, resume, step = controls.pause, controls.resume, partial(controls.step_by, 1)
    slower, unlimited = partial(controls.set_speed, 5.0), partial(controls.set_speed, None)
    plan = [pause, step, step, resume, slower, pause, step, resume, unlimited]
    asker = Asker(plan)
    controls.on_wait = asker.ask
    simulation.watch(asker)
    result = run_to_end(simulation)
    assert not plan
    assert controls.paused_ns > 0
    assert (result.ended, result.ticks) == ("duration", free.ticks)
    assert result.trajectory_sha256 == free.trajectory_sha256
    assert (result.radio, result.metrics) == (free.radio, free.metrics)


class Asker(Observer):
    """An observer that asks for one thing after each tick, and while the run is held."""

    def __init__(self, plan: list[Callable[[], None]]) -> None:
        self.plan = plan

    def see(self, truth: Truth) -> None:
        self.ask()

    def ask(self) -> None:
        if self.plan:
            self.plan.pop(0)()


def test_step_by_runs_that_many_ticks_paused_or_not() -> None:
    clock, controls, asking, _ = controlled()
    controls.step_by(2)
    asking.at_ms(500, lambda: controls.step_by(3))
    asking.at_ms(900, controls.resume)
    began_ms = []
    for tick in range(6):
        controls.wait(tick, never)
        began_ms.append((clock.time_ns - 77) // MS)
    assert began_ms == [0, 0, 520, 520, 520, 920]
    assert not controls.paused


def test_pause_cancels_pending_steps_and_holds_after_the_tick() -> None:
    _, controls, asking, _ = controlled()
    assert not controls.stands_still
    controls.pause()
    assert controls.stands_still  # before the first tick
    controls.step_by(5)
    assert not controls.stands_still
    controls.wait(0, never)
    controls.pause()
    assert not controls.stands_still  # the tick is under way
    stood: list[bool] = []
    asking.at_ms(100, lambda: stood.append(controls.stands_still))
    asking.at_ms(200, partial(controls.step_by, 1))
    asking.at_ms(200, lambda: stood.append(controls.stands_still))
    controls.wait(1, never)
    assert stood == [True, False]
    controls.resume()
    controls.wait(2, never)
    assert not controls.stands_still


def test_speed_that_cannot_be_is_refused() -> None:
    clock, controls, _, _ = controlled()
    for wrong in (0.0, -1.0, 1e9):
        with refused_input(match="factor: "):
            controls.set_speed(wrong)
    assert controls.speed is None
    _, paced, _, _ = controlled(1.0)
    with refused_input(match="wall clock"):
        paced.set_speed(None)
    with refused_input(match="programs elsewhere"):
        Controls(clock, RATE_HZ, speed_fixed=True).set_speed(2.0)


ASKING = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


def handlers() -> list[object]:
    return [signal.getsignal(number) for number in ASKING]


@pytest.mark.parametrize(
    ("numbers", "hung_up", "ends_at_once"),
    [
        ([signal.SIGINT], False, True),
        ([signal.SIGTERM], False, True),
        ([signal.SIGHUP] * 3, True, False),  # requests the end however often it arrives
    ],
)
def test_signal_requests_the_end_and_a_second_one_ends_at_once_unless_it_is_a_hang_up(numbers, hung_up, ends_at_once):
    before = handlers()
    with Interrupt() as interrupt:
        assert all(one != other for one, other in zip(handlers(), before, strict=True))
        assert not interrupt.requested
        for number in numbers:
            signal.raise_signal(number)
        assert (interrupt.requested, interrupt.hung_up) == (True, hung_up)
        if ends_at_once:
            with pytest.raises(KeyboardInterrupt):
                signal.raise_signal(numbers[0])
    assert handlers() == before


def test_hang_up_that_is_ignored_stays_ignored():
    """As nohup starts a program."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interrupt() as interrupt:
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert not interrupt.requested
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_hang_up_before_the_first_tick_has_exit_code_129():
    interrupt, message = Interrupt(), "interrupted while it waited for its runners"
    with pytest.raises(Interrupted), leaving_when_hung_up(interrupt):
        raise Interrupted(message)
    interrupt.hung_up = True
    with pytest.raises(typer.Exit) as ended, leaving_when_hung_up(interrupt):
        raise Interrupted(message)
    assert ended.value.exit_code == 129
