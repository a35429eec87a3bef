"""Recordings for the viewer: made of ticks by hand, and read back."""

from pathlib import Path

import numpy as np
import pytest

from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.pictures.viewer.recording import RerunRecording
from tests.support.clocks import StillClock
from tests.support.metrics.truths import truth, watch

rerun = pytest.importorskip("rerun", reason="needs the extra [view]")


def record(path: Path, run, ticks, **options):
    """The recording of these ticks, of which no row was dropped."""
    metrics = Metrics()
    recording = RerunRecording(path, metrics, StillClock(), **options)
    watch(run, ticks, metrics, recording)
    assert recording.end(None)["record_rrd"]["dropped"] == 0


def moving(run, ticks, **fields):
    """Robots that are somewhere else in each tick."""
    rng = np.random.default_rng(5)
    for tick in range(ticks):
        pose = rng.uniform(-3.0, 3.0, (run.arenas * run.robots, 3))
        yield truth(run, tick, pose=pose, **fields)


def column(path, entity, component):
    """What was logged of a component, by tick (None: once for the run): an array per row."""
    rows_by_tick = {}
    for chunk in rerun.chunk.RrdReader(str(path)).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            ticks = batch["tick"].to_pylist() if "tick" in batch.schema.names else [None] * batch.num_rows
            rows = batch[component].to_pylist()
            rows_by_tick.update({tick: row for tick, row in zip(ticks, rows, strict=True) if row is not None})
    return dict(sorted(rows_by_tick.items(), key=lambda item: -1 if item[0] is None else item[0]))


def series(path, plot):
    """Every line of a plot: {name: {tick: value}}, of the ticks in which it was drawn."""
    values = {}
    for before in range(20):
        entity = f"/plots/{plot}/since_{before}"
        for names in column(path, entity, "SeriesLines:names").values():
            rows = column(path, entity, "Scalars:scalars").items()
            values |= {name: {tick: row[i] for tick, row in rows} for i, name in enumerate(names)}
    return values


def class_names(path):
    """{class: (name, colour)} of the robots, as of the last tick."""
    *_, context = column(path, "/world", "AnnotationContext:context").values()
    infos = [item["class_description"]["info"] for item in context[0]]
    return {info["id"]: (info["label"], info["color"]) for info in infos}
