"""The run's side of control: its status, and answers in zenoh's own thread, as the loop may be busy or paused."""

# pyright: reportUnknownMemberType=false
# zenoh's stubs leave out the return types of reply and reply_err.

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from typing import Any

import zenoh

from swarmwire.comms.base.clock import Clock, tick_start_ns, to_s
from swarmwire.comms.base.errors import BadInput, SwarmwireError
from swarmwire.comms.observe.interfaces import Observer
from swarmwire.comms.observe.truth import Static, Truth
from swarmwire.comms.radio.config.radio import Radio
from swarmwire.comms.radio.config.ramps import numbers_of
from swarmwire.comms.radio.records import PacketCounts
from swarmwire.comms.wire.control_frames import ControlRequest, decode_request, encode_reply
from swarmwire.comms.wire.keys import ObserverKeys
from swarmwire.deploy.runs.controls import Controls
from swarmwire.metrics.measures.measure import Measured
from swarmwire.world.backends.runner_reports import RunnerHealth

NAMED = 1000  # robots: up to so many, their names are told; those of more follow from the groups
WAITS_S = 1.0  # for runners: a run that has waited so long is said to wait
SMOOTHING = 0.1  # weight of the newest tick in the mean time of a tick


class Status(Observer):
    """Observer that keeps the newest tick, which costs next to nothing; all else is computed on request.

    Of several arenas it reports the first, as publishing does, except counts, which are of all.
    """

    before_agents = True  # it begins before the run's agents are there

    def __init__(
        self,
        *,
        run_id: str,
        scenario: str,
        ticks: int,
        metrics: Measured,
        controls: Controls,
        clock: Clock,
        health: Callable[[], RunnerHealth | None],
        counts: Callable[[], Mapping[str, int]],
        radio: Callable[[], Radio | None],
        events: Callable[[], Sequence[Mapping[str, Any]]],
        compiled_ns: Callable[[], int] = lambda: 0,
    ) -> None:
        """Of a run of so many ticks; `metrics` must see each tick before, the callables give what is so now.

        `compiled_ns` gives the wall time spent on compiling so far, which is no part of a tick's.
        """
        self._run_id, self._scenario, self._ticks = run_id, scenario, ticks
        self._metrics, self._controls, self._clock = metrics, controls, clock
        self._health, self._counts, self._radio, self._events = health, counts, radio, events
        self._truth: Truth | None = None
        self._over = False
        self._compiled_ns = compiled_ns
        self._under_way: tuple[int, int] | None = None  # the tick that has begun: wall time, and compiled before it
        self._tick_ns: float | None = None

    def began(self) -> None:
        """A tick begins now."""
        self._under_way = self._clock.now_ns(), self._compiled_ns()

    def begin(self, static: Static) -> None:
        """Start afresh."""
        self._static = static

    def see(self, truth: Truth) -> None:
        """Keep it."""
        first, self._truth = self._truth is None, truth
        under_way, self._under_way = self._under_way, None
        if under_way is not None and not first:  # which is long: kernels are loaded in it
            began_ns, compiled_ns = under_way
            took_ns = self._clock.now_ns() - began_ns - (self._compiled_ns() - compiled_ns)
            self._tick_ns = took_ns if self._tick_ns is None else (1 - SMOOTHING) * self._tick_ns + SMOOTHING * took_ns

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """The run is over; nothing for the summary."""
        self._over = True
        return {}

    @property
    def tick(self) -> int:
        """Ticks done; also the number of the next one."""
        return self._truth.tick + 1 if self._truth else 0

    def now(self) -> dict[str, Any]:
        """The status, of texts, numbers, lists and maps alone; what is no number is None."""
        static, truth, tick = self._static, self._truth, self.tick
        health, radio = self._health(), self._radio()
        return {
            "run": self._run_id,
            "pid": os.getpid(),
            "scenario": self._scenario,
            "seeds": list(static.seeds),
            "tick": tick,
            "ticks": self._ticks,
            "time_s": to_s(tick_start_ns(tick, static.rate_hz)),
            "state": self._state(health),
            "speed": self._controls.speed,
            "real_time": self._controls.real_time,
            "alive": int(truth.alive[: static.robots].sum()) if truth else static.robots,
            "robots": static.robots,
            "robot_names": list(static.robot_names) if static.robots <= NAMED else [],
            "groups": {group.name: group.stop - group.start for group in static.groups},
            "runners": None if health is None else asdict(health),
            "counts": dict(self._counts()),
            "metrics": self._measured(),
            "radio": None if radio is None else numbers_of(radio),
            "events": [dict(event) for event in self._events()],
            "measures_ms": None if self._tick_ns is None else self._tick_ns / 1e6,
        }

    def _state(self, health: RunnerHealth | None) -> str:
        if self._over:
            return "over"
        if health and health.waits_s > WAITS_S:
            return "waiting"
        if self._controls.stands_still:
            return "paused"
        under_way = self._under_way
        return "compiling" if under_way is not None and self._compiled_ns() > under_way[1] else "running"

    def _measured(self) -> dict[str, float | None]:
        if self._truth is None:
            return {}
        latest = {name: float(values[0]) for name, values in self._metrics.latest.items()}
        return {name: value if isfinite(value) else None for name, value in latest.items()}


class ControlServer:
    """Answers who asks how a run is doing, and does what those ask who may control it.

    What is refused is answered with one line, and changes nothing. `give` takes an event's table and returns its
    number, `end` undoes an event; both are `LiveEvents`'.
    """

    def __init__(
        self,
        status: Status,
        controls: Controls,
        give: Callable[[Mapping[str, Any]], int],
        end: Callable[[int], None],
        note: Callable[[str], None],
    ) -> None:
        """`note` keeps in the run's log what was done."""
        self._status, self._controls, self._give, self._end, self._note = status, controls, give, end, note

    def declare(self, session: zenoh.Session, keys: ObserverKeys) -> object:
        """Answer on this session for as long as what is returned is kept."""

        def status(query: zenoh.Query) -> None:
            _answer(query, keys.status, lambda _: self._status.now())

        def control(query: zenoh.Query) -> None:
            _answer(query, keys.control, self._do)

        return (
            session.declare_queryable(keys.status, zenoh.handlers.Callback(status, indirect=False)),
            session.declare_queryable(keys.control, zenoh.handlers.Callback(control, indirect=False)),
        )

    def _do(self, payload: bytes) -> dict[str, Any]:
        request = decode_request(payload)
        done, number = self.do(request)
        self._note(f"control: {done}")
        return {"done": done, "tick": self._status.tick, "event": number}

    def do(self, request: ControlRequest) -> tuple[str, int | None]:
        """Do it: what was done in words, and the number of the event, if it is one; BadInput if it is refused."""
        controls, value = self._controls, request.value
        match request.do:
            case "pause":
                controls.pause()
                return "paused", None
            case "resume":
                controls.resume()
                return "running", None
            case "step":
                controls.step_by(value)
                return f"{value} {'tick' if value == 1 else 'ticks'}, then paused", None
            case "speed":
                controls.set_speed(value)
                return "as fast as possible" if value is None else f"{value:g} times real time", None
            case "stop":
                controls.quit()
                return "ending after this tick", None
            case "event":
                number = self._give(value)
                return f"event {number}: {value['do']}", number
            case "end":
                self._end(value)
                return f"event {value} ends", value
            case other:
                raise BadInput("", "do", f"nothing is known about {other!r}")


def _answer(query: zenoh.Query, key: str, work: Callable[[bytes], Mapping[str, Any]]) -> None:
    """Reply with what `work` makes of the request's bytes, or with the line that says why not."""
    try:
        reply = encode_reply(work(query.payload.to_bytes() if query.payload else b""))
    except SwarmwireError as error:
        query.reply_err(str(error))
    except Exception as error:  # noqa: BLE001 - an error here must not end zenoh's thread, nor the run
        query.reply_err(f"the run could not do it: {type(error).__name__}: {error}")
    else:
        query.reply(key, reply)
