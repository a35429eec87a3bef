"""Figures of a configuration in both simulators, whether they agree, and the tables of docs/dev/validation.md."""

import csv
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.ns3.configurations import Configuration
from benchmarks.ns3.simulators import Received
from swarmwire.comms.base.arrays import BoolArray, FloatArray
from swarmwire.comms.base.errors import BadInput

WPAN_REACH_M, WIFI_REACH_M = 100.0, 50.0  # about, of a lone frame in ns-3
BINS = 4
FEWEST_PAIRS = 20  # in a bin, over all seeds
OF_REACH = " % of reach"
DELIVERY, DELAY, THROUGHPUT = "delivery", "mean delay, ms", "throughput, Mbit/s"
LIMITS = {DELIVERY: 0.02, DELAY: 0.05, THROUGHPUT: 0.03}  # absolute; relative; relative
REASONS = {  # why rows are misses, by what their first cells match
    r"802.11a 54M .* 40 m square": "where more than half of short frames are lost the union bound of `802.11ag` is "
    "pessimistic, by up to 1 dB: [the receiver](../radio.md#noise-and-reception)",
    r"802.15.4 .* one spot, unicast": "a node of ns-3 that acknowledges while it waits for the channel restarts its "
    "channel access, and one that waits for an acknowledgement meanwhile takes it for lost (lr-wpan-mac.cc, "
    "PdDataIndication, marked there as open); here the backoff continues: IEEE 802.15.4-2006, 7.5.6.4, asks for "
    "neither",
    r"802.11n 65M .* 31 m, unicast": "short frames at MCS 7 are received at 0.38 dB less than in ns-3: [the "
    "receiver](../radio.md#noise-and-reception)",
    r"802.11n .* one spot, unicast$": "after A-MPDUs that collide, and for packets whose lifetime ends, ns-3 sends "
    "more requests of a block acknowledgement than a station here; single frames agree. Not traced further",
    r"802.11n .* [24] 40, 40 m, unicast": "packets of hidden senders wait longer here close to saturation; the cause "
    "was not found. Delivery and full queues agree",
}
Figures = dict[str, FloatArray]  # by name, (seeds,) each; NaN where nothing was received, or no pair is that far apart


def figures_of(configuration: Configuration, received: Received) -> Figures:
    """What is compared: mean delivery of pairs, also by distance; mean delay; or the throughput of full queues."""
    intended = _intended(configuration)
    count, delay_ns = received.packets.sum(axis=(1, 2)), received.delay_ns.sum(axis=(1, 2))
    if configuration.is_saturated:
        receivers = intended.sum() / configuration.senders
        bits = 8.0 * configuration.payload_bytes * count / receivers
        return {THROUGHPUT: 1e-6 * bits / configuration.measured_s}
    first, last = configuration.counted
    ratio = received.packets / (last - first)
    with np.errstate(invalid="ignore", divide="ignore"):
        delays = {DELAY: 1e-6 * delay_ns / count}
    if configuration.senders == 2 and configuration.layout in ("line", "pairs"):
        a, b = (ratio[:, sender, intended[sender]][:, 0] for sender in range(2))
        return {"delivery of a": a, "delivery of b": b, **delays}
    unicast: Figures = {}
    if configuration.is_mixed:
        to_one = intended.sum(axis=1, keepdims=True) == 1
        unicast = {"delivery of unicast": ratio[:, intended & to_one].mean(axis=1)}
        intended &= ~to_one
    bins = _bins(configuration, intended) if configuration.layout == "area" else {}
    return {
        "delivery": ratio[:, intended].mean(axis=1),
        **unicast,
        **delays,
        **{name: _mean(ratio, pairs) for name, pairs in bins.items()},
    }


def _intended(configuration: Configuration) -> BoolArray:
    """The intended receivers of each sender, (nodes, nodes)."""
    intended = ~np.eye(configuration.nodes, dtype=np.bool_)
    intended[configuration.senders :] = False
    if configuration.layout == "line":
        intended[:, : configuration.senders] = False
        return intended
    for sender in range(configuration.senders):
        to = configuration.receiver_of(sender)
        if to >= 0:
            intended[sender] = np.arange(configuration.nodes) == to
    return intended


def _bins(configuration: Configuration, intended: BoolArray) -> dict[str, BoolArray]:
    """Pairs by their distance, (seeds, nodes, nodes) each."""
    xy_m = configuration.xy_m()
    apart_m = np.linalg.norm(xy_m[:, :, None] - xy_m[:, None], axis=-1)
    reach_m = WPAN_REACH_M if configuration.standard == "802.15.4" else WIFI_REACH_M
    part, edges = apart_m / reach_m, np.linspace(0.0, 1.0, BINS + 1).tolist()
    bins = {
        f"{100 * near:g} to {100 * far:g}{OF_REACH}": intended & (part >= near) & (part < far)
        for near, far in pairwise(edges)
    }
    return {name: pairs for name, pairs in bins.items() if pairs.sum() >= FEWEST_PAIRS}


def _mean(ratio: FloatArray, pairs: BoolArray) -> FloatArray:
    with np.errstate(invalid="ignore"):
        return np.where(pairs, ratio, 0.0).sum(axis=(1, 2)) / pairs.sum(axis=(1, 2))


@dataclass(frozen=True)
class Agreement:
    """One figure in both, seed by seed with the same places and send times, (seeds,) each."""

    name: str
    ns3: FloatArray
    ours: FloatArray

    @property
    def kind(self) -> str:
        """The limit that holds for it: deliveries go by several names."""
        return self.name if self.name in LIMITS else DELIVERY

    @property
    def is_relative(self) -> bool:
        """Whether the difference counts as a share of ns-3's."""
        return self.kind != DELIVERY

    @property
    def differences(self) -> FloatArray:
        """Of the seeds in which both have it."""
        both = np.isfinite(self.ns3) & np.isfinite(self.ours)
        scale = self.ns3[both].mean() if self.is_relative and both.any() else 1.0
        return (self.ours - self.ns3)[both] / scale

    @property
    def is_comparable(self) -> bool:
        """Whether there is anything to compare: a delay needs packets that were received."""
        return len(self.differences) > 0

    @property
    def is_within(self) -> bool:
        """Whether the mean difference is within the limit."""
        return not self.is_comparable or abs(float(self.differences.mean())) <= LIMITS[self.kind]

    @property
    def cells(self) -> list[str]:
        """ns-3's mean and the difference, each with its standard error."""
        if not self.is_comparable:
            return ["-", "-"]
        scale, unit = (100.0, " %") if self.is_relative else (1.0, "")
        digits = 1 if self.is_relative else 3
        off = scale * self.differences
        return [
            f"{np.nanmean(self.ns3):.3f} ± {standard_error(self.ns3):.3f}",
            f"{off.mean():+.{digits}f}{unit} ± {standard_error(off):.{digits}f}",
        ]


def standard_error(values: FloatArray) -> float:
    """Of the mean of those that are numbers; 0 of a single one."""
    finite = values[np.isfinite(values)]
    return float(finite.std(ddof=1) / len(finite) ** 0.5) if len(finite) > 1 else 0.0


@dataclass(frozen=True)
class Row:
    """A configuration with all its figures."""

    configuration: Configuration
    agreements: list[Agreement]

    @classmethod
    def compare(cls, configuration: Configuration, ns3: Figures, ours: Figures) -> "Row":
        """The figures that both have, seed by seed."""
        return cls(configuration, [Agreement(name, ns3[name], ours[name]) for name in ours])

    @property
    def misses(self) -> list[str]:
        """Names of the figures that are off limits."""
        return [agreement.name for agreement in self.agreements if not agreement.is_within]

    @property
    def reason(self) -> str | None:
        """Why it is off limits; None if it is within them, or there are no limits."""
        title = " ".join(self.configuration.cells)
        return next((REASONS[key] for key in REASONS if self.misses and re.match(key, title)), None)


def table(rows: Iterable[Row]) -> list[str]:
    """Lines of Markdown: a row for each configuration, and the reasons of misses below."""
    rows = list(rows)
    names = list(dict.fromkeys(agreement.name for row in rows for agreement in row.agreements))
    main, bins = (
        [name for name in names if not name.endswith(OF_REACH)],
        [name for name in names if name.endswith(OF_REACH)],
    )
    columns = ["standard", "nodes", "bytes", "interval, ms", "where"]
    for name in main:
        columns += [f"ns-3: {name}", "ours - ns-3"]
    columns += [f"{name}: ns-3, ours - ns-3" for name in bins]
    lines = ["| " + " | ".join([*columns, "verdict"]) + " |", "| --- " * (len(columns) + 1) + "|"]
    notes: list[str] = []
    for row in rows:
        cells_by_name = {agreement.name: agreement.cells for agreement in row.agreements}
        cells = row.configuration.cells
        for name in main:
            cells += cells_by_name.get(name, ["", ""])
        cells += [", ".join(cells_by_name[name]) if name in cells_by_name else "" for name in bins]
        lines.append("| " + " | ".join([*cells, _verdict(row, notes)]) + " |")
    return [*lines, *(f"\n({number}) {note}" for number, note in enumerate(notes, 1))]


def summary(sections: Mapping[str, list[Row]]) -> list[str]:
    """Lines of Markdown: for each section how many rows are within, and the largest mean difference of each kind."""
    lines = ["| section | rows | within | delivery | mean delay | throughput |", "| --- " * 6 + "|"]
    every = [row for rows in sections.values() for row in rows]
    for name, rows in {**sections, "all": every}.items():
        cells = [name, str(len(rows)), str(sum(not row.misses for row in rows))]
        for kind in LIMITS:
            comparable = [
                agreement
                for row in rows
                for agreement in row.agreements
                if agreement.kind == kind and agreement.is_comparable
            ]
            off = max((abs(float(agreement.differences.mean())) for agreement in comparable), default=None)
            cells.append("" if off is None else f"{100 * off:.1f} %" if comparable[0].is_relative else f"{off:.3f}")
        lines.append("| " + " | ".join(cells) + " |")
    return ["Rows within the limits, and the largest mean differences:", "", *lines]


def _verdict(row: Row, notes: list[str]) -> str:
    """The verdict, with the number of its reason among `notes`, which it joins."""
    if not row.misses:
        return "within"
    reason = row.reason or "not explained"
    if reason not in notes:
        notes.append(reason)
    return f"**miss** ({notes.index(reason) + 1})"


def write_csv(page: Path, tables: Mapping[str, list[str]]) -> dict[str, list[str]]:
    """Write each table as a CSV file in a folder named like the page; return the lines that show it in the page."""
    folder = page.with_suffix("")
    folder.mkdir(exist_ok=True)
    shown: dict[str, list[str]] = {}
    for name, lines in tables.items():
        rows = [line[1:-1].split("|") for line in lines if line.startswith("| ") and not line.startswith("| ---")]
        with (folder / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([cell.strip() for cell in row] for row in rows)
        block = ["```{csv-table}", f":file: {folder.name}/{name}.csv", ":header-rows: 1", "```"]
        notes = [line for line in lines if not line.startswith("|")]
        shown[name] = [f"Rows: [{name}.csv]({folder.name}/{name}.csv)", "", *block, *notes]
    return shown


def filled(page: Path, tables: Mapping[str, list[str]]) -> str:
    """The page's text with these lines between the marks of each name; BadInput if it lacks them."""
    text = page.read_text(encoding="utf-8")
    for name, lines in tables.items():
        begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
        if text.count(begin) != 1 or text.count(end) != 1:
            raise BadInput(str(page), "", f"expected one line {begin}, and {end} below it")
        text = "\n".join([text.partition(begin)[0] + begin, *lines, end + text.partition(end)[2]])
    return text


# ns-3's figures as they were recorded, for tests and comparisons without ns-3.


RECORD = Path(__file__).parents[2] / "tests" / "support" / "comms" / "reference" / "ns3.json"
DIGITS = 6
HEAD = {
    "simulator": "ns-3",
    "version": "3.44 (package ns3 3.44.post0 of PyPI)",
    "command": "python -m benchmarks.ns3 --record",
    "what": "figures by seed, of nodes whose places and send times are those of the same seeds in the medium",
}


def recorded() -> dict[Configuration, Figures]:
    """The record: figures by seed of each configuration."""
    rows = json.loads(RECORD.read_text(encoding="utf-8"))["rows"]
    return {_configuration(row["configuration"]): _figures(row["figures"]) for row in rows}


def write_record(figures: dict[Configuration, Figures], every: Iterable[Configuration]) -> None:
    """Write figures of ns-3 as the record, a line for each configuration; those of others of `every` stay."""
    merged = recorded() | figures
    figures = {each: merged[each] for each in every if each in merged}
    lines = [
        json.dumps(
            {"configuration": each.as_mapping(), "figures": {n: _numbers(values) for n, values in own_figures.items()}}
        )
        for each, own_figures in figures.items()
    ]
    head = json.dumps(HEAD, indent=2)[:-2]
    rows = ",\n    ".join(lines)
    RECORD.parent.mkdir(parents=True, exist_ok=True)
    RECORD.write_text(f'{head},\n  "rows": [\n    {rows}\n  ]\n}}\n', encoding="utf-8")


def _numbers(values: np.ndarray) -> list[float | None]:
    return [round(float(value), DIGITS) if np.isfinite(value) else None for value in values]


def _figures(columns: dict[str, list[float | None]]) -> Figures:
    return {
        name: np.array([np.nan if value is None else value for value in values]) for name, values in columns.items()
    }


def _configuration(fields: dict[str, Any]) -> Configuration:
    return Configuration(**dict(fields, size_m=tuple(fields["size_m"])))
