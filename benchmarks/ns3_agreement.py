"""What ns-3 has and what the medium has, side by side: Markdown tables for the docs.

`python -m benchmarks.ns3_agreement [TABLE ...] [--runs N] [--ours MODULE:FUNCTION]`; the tables are `contention`,
`hidden-node` and `distance`, all unless some are named. Figures of ns-3 stand in `tests/support/comms/reference/`.
Those of contention are computed over seeds 1 to N, of the presets unless another function is named; scenarios in which
every node sends at the tick's start are left out, since the function cannot be told.
"""

import argparse
import importlib
import statistics
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, cast

from benchmarks import ns3_distance, ns3_hidden_node
from benchmarks.ns3_reference import radio_in_one_spot, recorded
from swarmwire.comms.radio.analysis.contention import contention as contend

CONTENTION = ("ns3_802154_contention.json", "ns3_80211_contention.json")
RATIO_LIMIT, DELAY_LIMIT = 0.03, 0.15  # absolute; relative
TABLES = {
    "contention": "Contention in one spot",
    "hidden-node": "Two senders hidden from each other",
    "distance": "Delivery over distance",
}


class Contention(Protocol):
    """What the medium offers: nodes in one spot that send to all, each at a phase and jitter of its own."""

    def __call__(
        self, *, technology: str, nodes: int, payload_bytes: int, interval_s: float, seed: int
    ) -> Mapping[str, float | None]:
        """`delivery_ratio` in [0, 1] and `mean_delay_s`, which is None if nothing was received."""
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


def measured(contention: Contention, scenario: Scenario, seeds: Sequence[int]) -> Ours:
    """What the medium makes of a scenario."""
    found = [
        contention(
            technology=scenario.technology,
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
    *, technology: str, nodes: int, payload_bytes: int, interval_s: float, seed: int
) -> Mapping[str, float | None]:
    """What the medium makes of nodes in one spot with the preset of this technology."""
    found = contend(radio_in_one_spot(technology), nodes, payload_bytes, interval_s, [seed])
    return {"delivery_ratio": found.delivery_ratio, "mean_delay_s": found.mean_delay_s}


def named(where: str) -> Contention:
    """The function at `module:function`."""
    module, _, name = where.partition(":")
    return cast("Contention", getattr(importlib.import_module(module), name))


def tables(contention: Contention, runs: int) -> dict[str, Iterator[str]]:
    """All tables, by name."""
    return {
        "contention": table(contention, range(1, runs + 1)),
        "hidden-node": ns3_hidden_node.table(),
        "distance": ns3_distance.table(),
    }


def main(arguments: Sequence[str]) -> int:
    """Print the tables; 1 if a row is off limits."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ns3_agreement", description="agreement with ns-3")
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"{', '.join(TABLES)} (default: all)")
    parser.add_argument("--ours", metavar="MODULE:FUNCTION", help="what computes contention (default: the presets)")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="of contention: seeds 1 to N (default 5)")
    options = parser.parse_args(arguments)
    if unknown := set(options.tables) - set(TABLES):
        parser.error(f"TABLE: expected {', '.join(TABLES)}; got {', '.join(sorted(unknown))}")
    found = tables(of_presets if options.ours is None else named(options.ours), options.runs)
    off_limits = 0
    for name in options.tables or TABLES:
        print(f"\n{TABLES[name]}:\n", flush=True)
        for line in found[name]:
            print(line, flush=True)
            off_limits += "**no**" in line
    return 1 if off_limits else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
