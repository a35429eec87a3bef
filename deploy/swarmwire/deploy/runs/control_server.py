"""The run's side of remote control: its status, and answers in zenoh's thread, since the loop may be busy or paused."""

# pyright: reportUnknownMemberType=false
# zenoh's stubs omit the return types of reply and reply_err.

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
from swarmwire.metrics.measures.measure import MetricValues
from swarmwire.world.backends.runner_reports import RunnerHealth

MAX_NAMES = 1000  # robots of a swarm whose status has their names; other names follow from the groups
WAITING_S = 1.0  # wait for runners after which the state of the run is "waiting"
SMOOTHING = 0.1  # weight of the newest tick in the mean time of a tick


class Status(Observer):
    """Observer that keeps the newest tick, which costs next to nothing, and computes the status on request.

    It reports the first of several arenas, like `Published`, except for counts, which are of all arenas.
    """

    before_agents = True

    def __init__(
        self,
        *,
        run_id: str,
        scenario: str,
        ticks: int,
        metrics: MetricValues,
        controls: Controls,
        clock: Clock,
        health: Callable[[], RunnerHealth | None],
        counts: Callable[[], Mapping[str, int]],
        radio: Callable[[], Radio | None],
        events: Callable[[], Sequence[Mapping[str, Any]]],
        compiled_ns: Callable[[], int] = lambda: 0,
        poses: Callable[[], Sequence[Mapping[str, Any]]] = tuple,
    ) -> None:
        """Make the status of a run; the callables return present values.

        Args:
            run_id: the name of the execution.
            scenario: the name of the scenario.
            ticks: the ticks of the whole run.
            metrics: the metrics, which see each tick before.
            controls: the controls of the run.
            clock: the wall clock.
            health: returns the state of the runners.
            counts: returns the counts of faults.
            radio: returns the present radio.
            events: returns the list of events.
            compiled_ns: returns the wall time spent on compiling, which is no part of a tick's time.
            poses: returns the ages of poses of live sources.
        """
        self._run_id, self._scenario, self._ticks = run_id, scenario, ticks
        self._metrics, self._controls, self._clock = metrics, controls, clock
        self._health, self._counts, self._radio, self._events = health, counts, radio, events
        self._truth: Truth | None = None
        self._is_over = False
        self._compiled_ns, self._poses = compiled_ns, poses
        self._present_tick: tuple[int, int] | None = None  # wall time at its start, and time compiled before it
        self._tick_ns: float | None = None

    def began(self) -> None:
        """Note the start of a tick."""
        self._present_tick = self._clock.now_ns(), self._compiled_ns()

    def begin(self, static: Static) -> None:
        """Keep the constants of the run."""
        self._static = static

    def see(self, truth: Truth) -> None:
        """Keep the tick."""
        first, self._truth = self._truth is None, truth
        present_tick, self._present_tick = self._present_tick, None
        if present_tick is not None and not first:  # the first tick is long, since it loads kernels
            start_ns, compiled_ns = present_tick
            tick_ns = self._clock.now_ns() - start_ns - (self._compiled_ns() - compiled_ns)
            self._tick_ns = tick_ns if self._tick_ns is None else (1 - SMOOTHING) * self._tick_ns + SMOOTHING * tick_ns

    def end(self, last: PacketCounts | None) -> dict[str, Any]:
        """Note the end of the run; there is no entry of the summary."""
        self._is_over = True
        return {}

    @property
    def tick(self) -> int:
        """Number of ticks done; also the number of the next tick."""
        return self._truth.tick + 1 if self._truth else 0

    def now(self) -> dict[str, Any]:
        """Return the status as texts, numbers, lists and maps; None instead of NaN."""
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
            "robot_names": list(static.robot_names) if static.robots <= MAX_NAMES else [],
            "groups": {group.name: group.stop - group.start for group in static.groups},
            "runners": None if health is None else asdict(health),
            "counts": dict(self._counts()),
            "poses": [] if self._is_over else [dict(ages) for ages in self._poses()],
            "metrics": self._latest_metrics(),
            "radio": None if radio is None else numbers_of(radio),
            "events": [dict(event) for event in self._events()],
            "measures_ms": None if self._tick_ns is None else self._tick_ns / 1e6,
        }

    def _state(self, health: RunnerHealth | None) -> str:
        if self._is_over:
            return "over"
        if health and health.waits_s > WAITING_S:
            return "waiting"
        if self._controls.stands_still:
            return "paused"
        is_compiling = self._present_tick is not None and self._compiled_ns() > self._present_tick[1]
        return "compiling" if is_compiling else "running"

    def _latest_metrics(self) -> dict[str, float | None]:
        if self._truth is None:
            return {}
        latest = {name: float(values[0]) for name, values in self._metrics.latest.items()}
        return {name: value if isfinite(value) else None for name, value in latest.items()}


class ControlServer:
    """Answers status and control requests of observers and operators.

    A refused request gets one line as its answer, and changes nothing.
    """

    def __init__(
        self,
        status: Status,
        controls: Controls,
        submit: Callable[[Mapping[str, Any]], int],
        end: Callable[[int], None],
        note: Callable[[str], None],
    ) -> None:
        """`submit` and `end` are those of `LiveEvents`; `note` logs each request that was carried out."""
        self._status, self._controls, self._submit, self._end, self._note = status, controls, submit, end, note

    def declare(self, session: zenoh.Session, keys: ObserverKeys) -> object:
        """Answer on this session while the result is referenced."""

        def status(query: zenoh.Query) -> None:
            _answer(query, keys.status, lambda _: self._status.now())

        def control(query: zenoh.Query) -> None:
            _answer(query, keys.control, self._control)

        return (
            session.declare_queryable(keys.status, zenoh.handlers.Callback(status, indirect=False)),
            session.declare_queryable(keys.control, zenoh.handlers.Callback(control, indirect=False)),
        )

    def _control(self, payload: bytes) -> dict[str, Any]:
        request = decode_request(payload)
        message, number = self.do(request)
        self._note(f"control: {message}")
        return {"done": message, "tick": self._status.tick, "event": number}

    def do(self, request: ControlRequest) -> tuple[str, int | None]:
        """Carry out a request; return a message, and the number of its event, if any. BadInput if it is refused."""
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
                number = self._submit(value)
                return f"event {number}: {value['do']}", number
            case "end":
                self._end(value)
                return f"event {value} ends", value
            case other:
                raise BadInput("", "do", f"nothing is known about {other!r}")


def _answer(query: zenoh.Query, key: str, work: Callable[[bytes], Mapping[str, Any]]) -> None:
    """Reply with the result of `work` for the request's bytes, or with its error in a line."""
    try:
        reply = encode_reply(work(query.payload.to_bytes() if query.payload else b""))
    except SwarmwireError as error:
        query.reply_err(str(error))
    except Exception as error:  # noqa: BLE001 - an error here must not end zenoh's thread, nor the run
        query.reply_err(f"the run could not do it: {type(error).__name__}: {error}")
    else:
        query.reply(key, reply)
