"""Learning under loss: flocking and search by trained policies and by hand-written rules, over packet loss."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from docs.experiments.figures._side_by_side import legend, mean_and_interval, means, panels, table, within
from swarmwire.comms.base.arrays import FloatArray
from swarmwire.metrics.pictures.drawing.canvas import ACCENT, CURVE, SOFT
from swarmwire.metrics.statistics.difference import difference
from swarmwire.metrics.statistics.sample import number_sample


class Task(NamedTuple):
    """A task of both campaigns, of the rule and of the policies."""

    name: str
    column: str  # the response
    title: str
    digits: int


TASKS = (
    Task("flocking", "flock.mean", "flocking: share in one aligned flock", 2),
    Task("search", "find_time_s", "search: time until half are at the light, s", 0),
)
CAMPAIGNS = tuple(f"learning-{task.name}{suffix}" for task in TASKS for suffix in ("-rule", ""))
COLUMNS = ()  # `digested` chooses
AGENTS = {  # by what the file's name ends with; "": no file
    "": ("hand-written rule", SOFT),
    "lossless.onnx": ("trained without loss", ACCENT),
    "lossy.onnx": ("trained under loss", CURVE),
}


def digested(_: Path, runs: pl.DataFrame) -> pl.DataFrame:
    """The response of each run, by loss and agent; a time that did not come is the length of the run."""
    response = next(task.column for task in TASKS if task.column in runs.columns)
    agent = next((pl.col(name) for name in runs.columns if name.endswith(".agent")), pl.lit(""))
    return runs.select(
        "run",
        "point",
        "seed",
        "ended",
        pl.col("radio.loss").alias("loss"),
        agent.alias("agent"),
        pl.col(response).fill_null(pl.col("sim_time_s")).alias("response"),
        pl.col(response).is_not_null().alias("observed"),
        pl.col("collisions.final").alias("collisions"),
        "timing_wall_s",
    )


def results(runs: Mapping[str, pl.DataFrame], task: Task) -> Mapping[str, Mapping[float, pl.DataFrame]]:
    """The runs of a task, by who acts and by loss; in the order of seeds."""
    both = pl.concat([runs[f"learning-{task.name}-rule"], runs[f"learning-{task.name}"]])
    ran = both.filter(pl.col("ended") != "failed").sort("seed")
    by_agent: dict[str, dict[float, pl.DataFrame]] = {}
    for end, (agent_label, _) in AGENTS.items():
        agent_runs = ran.filter(pl.col("agent").str.ends_with(f"-{end}") if end else pl.col("agent") == "")
        by_agent[agent_label] = {
            loss: agent_runs.filter(pl.col("loss") == loss) for loss in agent_runs["loss"].unique().sort()
        }
    return by_agent


def values(runs: pl.DataFrame) -> FloatArray:
    """The response of each run, (runs,)."""
    return runs["response"].to_numpy()


def draw(runs: Mapping[str, pl.DataFrame]) -> Any:
    """A panel for each task: means over seeds with their intervals."""
    figure, axes = panels(*((task.title, "packet loss") for task in TASKS))
    for ax, task in zip(axes, TASKS, strict=True):
        for (agent_label, by_loss), (_, color) in zip(results(runs, task).items(), AGENTS.values(), strict=True):
            means(ax, list(by_loss), [values(group) for group in by_loss.values()], color=color, label=agent_label)
        ax.set_ylim(bottom=0.0)
    legend(axes[0], loc="lower left")
    return figure


def numbers(runs: Mapping[str, pl.DataFrame]) -> str:
    """The response at each loss, how the policy trained under loss differs from both others, and contacts."""
    seeds = runs[CAMPAIGNS[0]]["seed"].n_unique()
    minutes = sum(float(frame["timing_wall_s"].sum()) for frame in runs.values()) / 60.0
    lines = [f"{sum(map(len, runs.values()))} runs, {seeds} seeds a point; {minutes:.0f} minutes of one worker."]
    for task in TASKS:
        lines += ["", f"**{task.title[0].upper()}{task.title[1:]}:**", "", _table(results(runs, task), task)]
        lines += ["", _contacts(results(runs, task))]
    return "\n".join(lines)


def _table(by_agent: Mapping[str, Mapping[float, pl.DataFrame]], task: Task) -> str:
    rule, lossless, lossy = by_agent
    head = ["loss", *by_agent, "third, less first", "third, less second"]
    rows: list[list[str]] = []
    for loss in by_agent[rule]:
        cells = [_cell(by_loss[loss], task) for by_loss in by_agent.values()]
        apart = [_apart(by_agent[other][loss], by_agent[lossy][loss], task) for other in (rule, lossless)]
        rows.append([f"{loss:g}", *cells, *apart])
    return table(head, rows)


def _apart(first: pl.DataFrame, second: pl.DataFrame, task: Task) -> str:
    effect = difference(number_sample(values(first)), number_sample(values(second)))
    return within(effect.mean, effect.mean_interval, task.digits)


def _contacts(by_agent: Mapping[str, Mapping[float, pl.DataFrame]]) -> str:
    """Contacts between robots a run, over all losses."""
    every = {
        agent_label: pl.concat(by_loss.values())["collisions"].cast(pl.Float64).to_numpy()
        for agent_label, by_loss in by_agent.items()
    }
    contacts = ", ".join(f"{agent_label} {collisions.mean():.1f}" for agent_label, collisions in every.items())
    return f"Contacts between robots a run, over all losses: {contacts}."


def _cell(runs: pl.DataFrame, task: Task) -> str:
    mean, interval = mean_and_interval(values(runs))
    never = int((~runs["observed"]).sum())
    return within(mean, interval, task.digits) + (f", {never} never" if never else "")
