"""A random schedule of faults: processes, faults and ticks, all drawn from one seed."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

Family = Literal["wait", "goes on", "real time", "own runners", "world killed", "campaign"]
FaultKind = Literal["killed", "frozen", "frozen too long", "slowed", "leaves"]

SHARES: dict[Family, float] = {
    "wait": 0.30,
    "goes on": 0.20,
    "real time": 0.20,
    "own runners": 0.10,
    "world killed": 0.10,
    "campaign": 0.10,
}
WHATS: dict[FaultKind, float] = {"killed": 0.4, "frozen": 0.2, "frozen too long": 0.1, "slowed": 0.15, "leaves": 0.15}
ROBOTS = 8
TIMEOUT_S = 1.5  # timeout of a runner


@dataclass(frozen=True)
class Fault:
    """A fault of a process."""

    tick: int
    target: str  # r0, router, observer0, …
    kind: FaultKind
    for_s: float  # how long it is frozen, or until it is started again


@dataclass(frozen=True)
class Plan:
    """One schedule.

    Attributes:
        robots: of each runner, in order.
        late: runners, of the last, that come after the run began.
        speed: simulated seconds per second of wall time.
    """

    seed: int
    family: Family
    on_loss: str
    ticks: int
    speed: float
    robots: tuple[int, ...]
    late: int
    router: bool
    observers: int
    faults: tuple[Fault, ...]

    def __str__(self) -> str:
        parts = [f"{len(self.robots)} runners", self.on_loss]
        parts += ["router"] if self.router else []
        parts += [f"{self.late} late"] if self.late else []
        happens = ", ".join(f"{fault.target} {fault.kind} at {fault.tick}" for fault in self.faults)
        return f"{self.family} ({', '.join(parts)}): {happens or 'nothing'}"


def draw(seed: int, family: Family | None = None) -> Plan:
    """The schedule of a seed, if given of this family."""
    rng = np.random.default_rng([seed, 12])
    drawn: Family = _draw_key(rng, SHARES)
    family = family or drawn
    runners, ticks = int(rng.integers(2, 5)), int(rng.integers(50, 90))
    cuts = np.sort(rng.choice(np.arange(1, ROBOTS), runners - 1, replace=False))
    robots = tuple(int(n) for n in np.diff([0, *cuts, ROBOTS]))
    on_loss = {
        "wait": "wait",
        "goes on": str(rng.choice(["stand", "coast"])),
        "real time": str(rng.choice(["stand", "coast", "wait"])),
        "own runners": str(rng.choice(["stop", "dead", "stand", "coast"])),
        "world killed": str(rng.choice(["stop", "wait"])),
        "campaign": "stop",
    }[family]
    joined = family in ("wait", "goes on", "real time")
    router, observers = joined and bool(rng.random() < 0.25), int(rng.integers(0, 3))
    late = int(rng.integers(0, runners)) if on_loss in ("stand", "coast") and joined else 0
    cast = [f"r{at}" for at in range(runners)] * 2
    cast += [f"observer{at}" for at in range(observers)] + (["router"] if router else [])
    faults = sorted(
        (_fault(rng, ticks, cast) for _ in range(int(rng.integers(1, 6)))), key=lambda fault: (fault.tick, fault.target)
    )
    return Plan(seed, family, on_loss, ticks, 2.0, robots, late, router, observers, tuple(faults))


def _fault(rng: np.random.Generator, ticks: int, cast: list[str]) -> Fault:
    target, kind = cast[int(rng.integers(len(cast)))], _draw_key(rng, WHATS)
    for_s = float(rng.uniform(0.05, 1.0))
    if kind == "frozen":
        for_s *= 0.5
    if kind == "frozen too long":
        for_s += TIMEOUT_S + 0.2
    return Fault(int(rng.integers(0, ticks - 10)), target, kind, round(for_s, 2))


def _draw_key(rng: np.random.Generator, shares):
    weights = np.array(list(shares.values()))
    return list(shares)[int(rng.choice(len(weights), p=weights / weights.sum()))]
