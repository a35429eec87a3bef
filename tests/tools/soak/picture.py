"""The curves of a soak as a picture: `python -m tests.tools.soak.picture FOLDER docs/reliability-soak.svg`."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from swarmwire.metrics.report.page import as_svg, blank_figure
from tests.tools.soak.samples import Sample, cpu_per_tick_ms, read_samples

SHOWN = {
    "lockstep world": "#1d4ed8",
    "realtime world": "#0f766e",
    "lockstep runner": "#b45309",
    "realtime runner": "#f59e0b",
    "lockstep observer": "#7c3aed",
    "lockstep page": "#db2777",
}
SMOOTHED = 7  # samples, of what a tick costs


def draw(folder: Path, to: Path) -> None:
    """Write the picture: memory, descriptors, threads, what a tick costs, and how many there were, over the time."""
    samples = read_samples(folder / "samples.csv")
    figure = blank_figure(9.0, 8.0)
    axes: Sequence[Any] = figure.subplots(5, 1, sharex=True)
    texts = ("memory, MiB", "descriptors", "threads", "processor\ntime of a\ntick, ms", "ticks\nso far")
    for ax, text in zip(axes, texts, strict=True):
        ax.set_ylabel(text, fontsize=8)
        ax.tick_params(labelsize=8)
        ax.grid(alpha=0.3)
    for who, colour in SHOWN.items():
        rows = samples[who]
        minutes = [row.at_s / 60.0 for row in rows]
        for ax, values in zip(axes, _values(rows), strict=False):
            ax.plot(minutes, values, color=colour, lw=1.0, label=who)
        if who.endswith("world"):
            costs = cpu_per_tick_ms(rows)
            axes[3].plot([at_s / 60.0 for at_s, _ in costs], _smooth([ms for _, ms in costs]), color=colour, lw=1.0)
            axes[4].plot(minutes, [row.tick for row in rows], color=colour, lw=1.0)
    for ax in axes:
        ax.set_ylim(bottom=0)
    axes[-1].set_xlabel("minutes", fontsize=8)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="upper center", ncols=3, fontsize=8, frameon=False)
    figure.subplots_adjust(left=0.1, right=0.98, top=0.92, bottom=0.06, hspace=0.12)
    to.write_text(as_svg(figure, "soak") + "\n", encoding="utf-8")


def _values(rows: Sequence[Sample]) -> tuple[list[float], ...]:
    return (
        [row.rss_mib for row in rows],
        [float(row.descriptors) for row in rows],
        [float(row.threads) for row in rows],
    )


def _smooth(values: Sequence[float]) -> list[float]:
    """The running median."""
    half = SMOOTHED // 2
    parts = (sorted(values[max(0, at - half) : at + half + 1]) for at in range(len(values)))
    return [part[len(part) // 2] for part in parts]


if __name__ == "__main__":
    draw(Path(sys.argv[1]), Path(sys.argv[2]))
