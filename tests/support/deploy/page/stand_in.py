"""A run that only says what it was asked for: in place of `RemoteControl`."""

import threading
from typing import Any

from swarmwire.deploy.control.remote_control import Refused
from swarmwire.deploy.live.following import RunGone


class StandIn:
    """Keeps what it was asked for; refuses events that are not known, and is gone once `gone` is set."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Any]] = []
        self.tick, self.state, self.gone = 0, "running", False
        self.told = threading.Event()  # a status was asked for

    def status(self) -> dict[str, Any]:
        if self.gone:
            raise RunGone("nobody answers")
        self.told.set()
        metrics = {"order": 0.5, "rejoin_median": None}
        return {"tick": self.tick, "ticks": 100, "time_s": self.tick / 10, "state": self.state, "metrics": metrics,
                "measures_ms": 1.5, "alive": 3}  # fmt: skip

    def pause(self) -> None:
        self.asked.append(("pause", None))

    def resume(self) -> None:
        self.asked.append(("resume", None))

    def step(self, n: int = 1) -> None:
        self.asked.append(("step", n))

    def speed(self, factor: float | None) -> None:
        self.asked.append(("speed", factor))

    def stop(self) -> None:
        self.asked.append(("stop", None))

    def event(self, table: dict[str, Any]) -> int:
        if table.get("do") != "kill":
            raise Refused("do: expected something that can happen")
        self.asked.append(("event", table))
        return 7

    def end(self, number: int) -> None:
        self.asked.append(("end", number))
