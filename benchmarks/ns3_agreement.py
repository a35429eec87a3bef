"""Contention as ns-3 has it and as the air has it, side by side: a Markdown table for the docs.

`python -m benchmarks.ns3_agreement [--runs N] [--ours MODULE:FUNCTION]`. ns-3's figures were recorded once, in
`tests/comms/reference/`; ours are computed over seeds 1 to N, of the presets unless another function is named.
Scenarios in which every node sends at the tick's start are left out, since the function cannot be told.
"""

import argparse
import importlib
import json
import statistics
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

from swarmwire.comms.air.contention import contention as contend
from swarmwire.deploy.probe import radio_of

REFERENCE = Path(__file__).parents[1] / "tests" / "comms" / "reference"
CONTENTION = ("ns3_802154_contention.json", "ns3_80211_contention.json")
PRESETS = {"802.15.4": "ieee802154", "802.11a 6 Mbit/s": "wifi-a-6M", "802.11b 1 Mbit/s": "wifi-b-1M"}
AS_RUN = {  # ns-3 was run without IP and UDP headers, and its 802.15.4 queue has no end
    "ieee802154": ["radio.queue_limit=1000000"],
    "wifi-a-6M": ["radio.overhead_bytes=36"],
    "wifi-b-1M": ["radio.overhead_bytes=36"],
}
RATIO_LIMIT, DELAY_LIMIT = 0.03, 0.15  # absolute; relative


class Contention(Protocol):
    """What the air offers: nodes in one spot that send to all, each at a phase and jitter of its own."""

    def __call__(
        self, *, preset: str, nodes: int, payload_bytes: int, interval_s: float, seed: int
    ) -> Mapping[str, float | None]:
        """`delivery_ratio` in [0, 1] and `mean_delay_s`, which is None if nothing was heard."""
        ...


@dataclass(frozen=True)
class Scenario:
    """A row of the reference: who sends what, and what came of it in ns-3."""

    technology: str
    nodes: int
    payload_bytes: int
    interval_s: float
    delivery_ratio: float
    mean_delay_s: float | None
    compares_delay: bool

    @property
    def title(self) -> str:
        """Its first cells in the table."""
        return f"{self.technology} | {self.nodes} | {self.payload_bytes} | {self.interval_s:g}"


@dataclass(frozen=True)
class Ours:
    """Means over the seeds."""

    delivery_ratio: float
    mean_delay_s: float | None


def scenarios() -> list[Scenario]:
    """The recorded scenarios in which nodes send at phases of their own."""
    rows = [row for name in CONTENTION for row in recorded(name)["rows"] if row["sending"] == "spread"]
    return [
        Scenario(
            row["technology"],
            row["nodes"],
            row["payload_bytes"],
            row["interval_s"],
            row["delivery_ratio"],
            row["mean_delay_s"],
            not row.get("queue_bound", False),  # else it is the delay of ns-3's queue, which is not under test
        )
        for row in rows
    ]


def recorded(name: str) -> dict[str, Any]:
    """One file of the reference: what was run, and `rows`."""
    return json.loads((REFERENCE / name).read_text(encoding="utf-8"))


def measured(contention: Contention, scenario: Scenario, seeds: Sequence[int]) -> Ours:
    """What the air makes of a scenario."""
    found = [
        contention(
            preset=PRESETS[scenario.technology],
            nodes=scenario.nodes,
            payload_bytes=scenario.payload_bytes,
            interval_s=scenario.interval_s,
            seed=seed,
        )
        for seed in seeds
    ]
    ratios = [ratio for one in found if (ratio := one["delivery_ratio"]) is not None]
    delays_s = [delay_s for one in found if (delay_s := one["mean_delay_s"]) is not None]
    return Ours(statistics.mean(ratios), statistics.mean(delays_s) if delays_s else None)


def agrees(scenario: Scenario, ours: Ours) -> bool:
    """Whether both figures lie within the limits; a delay counts where ns-3's is one of contention."""
    if abs(ours.delivery_ratio - scenario.delivery_ratio) > RATIO_LIMIT:
        return False
    if not scenario.compares_delay or scenario.mean_delay_s is None:
        return True
    return ours.mean_delay_s is not None and abs(ours.mean_delay_s / scenario.mean_delay_s - 1.0) <= DELAY_LIMIT


def table(contention: Contention, seeds: Sequence[int]) -> Iterator[str]:
    """Lines of the table, each as soon as it is known."""
    columns = ["technology", "nodes", "payload, bytes", "interval, s", "ns-3: delivered", "ns-3: delay, ms"]
    columns += ["ours: delivered", "difference", "ours: delay, ms", "difference", "within limits"]
    yield "| " + " | ".join(columns) + " |"
    yield "| --- " * len(columns) + "|"
    for scenario in scenarios():
        cells = [scenario.title, f"{scenario.delivery_ratio:.3f}", milliseconds(scenario.mean_delay_s)]
        cells += compared(scenario, measured(contention, scenario, seeds))
        yield "| " + " | ".join(cells) + " |"


def compared(scenario: Scenario, ours: Ours) -> list[str]:
    """Our cells of a line."""
    return [
        f"{ours.delivery_ratio:.3f}",
        f"{ours.delivery_ratio - scenario.delivery_ratio:+.3f}",
        milliseconds(ours.mean_delay_s),
        longer(scenario, ours.mean_delay_s),
        "yes" if agrees(scenario, ours) else "**no**",
    ]


def longer(scenario: Scenario, delay_s: float | None) -> str:
    """By how much our delay is longer, in percent."""
    if not scenario.compares_delay:
        return "(queue)"
    if delay_s is None or scenario.mean_delay_s is None:
        return "-"
    return f"{100.0 * (delay_s / scenario.mean_delay_s - 1.0):+.0f} %"


def milliseconds(delay_s: float | None) -> str:
    """A delay as a cell."""
    return "-" if delay_s is None else f"{1e3 * delay_s:.2f}"


def of_presets(
    *, preset: str, nodes: int, payload_bytes: int, interval_s: float, seed: int
) -> Mapping[str, float | None]:
    """What the air makes of nodes in one spot with this preset."""
    radio = radio_of(preset, AS_RUN[preset])
    found = contend(radio, nodes, payload_bytes, interval_s, [seed])
    return {"delivery_ratio": found.delivery_ratio, "mean_delay_s": found.mean_delay_s}


def named(where: str) -> Contention:
    """The function at `module:function`."""
    module, _, name = where.partition(":")
    return cast("Contention", getattr(importlib.import_module(module), name))


def main(arguments: Sequence[str]) -> int:
    """Print the table; 1 if a scenario is off limits."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ns3_agreement", description="agreement with ns-3")
    parser.add_argument("--ours", metavar="MODULE:FUNCTION", help="what computes ours (default: the presets)")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="seeds 1 to N (default 5)")
    options = parser.parse_args(arguments)
    contention = of_presets if options.ours is None else named(options.ours)
    off_limits = 0
    for line in table(contention, range(1, options.runs + 1)):
        print(line, flush=True)
        off_limits += "**no**" in line
    return 1 if off_limits else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
