"""What packet loss does to a flock: a few seeds for each loss, as a table of medians.

    python examples/loss_sweep.py [SCENARIO] [--seeds 5] [--duration 30]

Every run is a call of `run`; seeds share one world, which is faster, and each gives what it gives alone.
"""

import argparse
from pathlib import Path

import polars as pl

from swarmwire.deploy import run

FLOCK = Path(__file__).parents[1] / "scenarios" / "flocking-lossy.toml"
LOSSES = (0.0, 0.3, 0.6, 0.9)


def table(scenario: Path, seeds: int, duration_s: float) -> pl.DataFrame:
    """A row per loss and seed: the link PDR (received / receivers in range) and the order at the end."""
    rows: list[dict[str, float | int | None]] = []
    for loss in LOSSES:
        overrides = [f"radio.loss={loss}", f"duration_s={duration_s}"]
        result = run(scenario, seeds=range(1, seeds + 1), overrides=overrides)
        for arena in result.arenas:
            link_pdr = arena.radio.link_pdr if arena.radio else None
            rows.append({"loss": loss, "seed": arena.seed, "link_pdr": link_pdr, "order": arena.metrics["order"].final})
    return pl.DataFrame(rows)


def main() -> None:
    options = argparse.ArgumentParser(description="What packet loss does to a flock.")
    options.add_argument("scenario", nargs="?", type=Path, default=FLOCK)
    options.add_argument("--seeds", type=int, default=5)
    options.add_argument("--duration", type=float, default=30.0, help="simulated seconds of each run")
    arguments = options.parse_args()
    runs = table(arguments.scenario, arguments.seeds, arguments.duration)
    medians = runs.group_by("loss", maintain_order=True).agg(pl.col("link_pdr", "order").median(), runs=pl.len())
    with pl.Config(tbl_formatting="ASCII_MARKDOWN", tbl_hide_column_data_types=True, tbl_hide_dataframe_shape=True):
        print(medians)


if __name__ == "__main__":
    main()
