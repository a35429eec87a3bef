"""The fields of `summary.json`."""

from dataclasses import replace
from typing import Any

from swarmwire.comms.packets import FATE_NAMES
from swarmwire.deploy import Result
from swarmwire.metrics.registry import METRICS
from tests.tools.stable.recorded_run import recorded
from tests.tools.stable.samples import LEFT_OUT, joined, lines_of, paths_of, sample


def text() -> str:
    """A field a line; then those that are lists where a run has several arenas, and the metrics that there are."""
    made_up = [[paths_of(_summary(left_out, arenas)) for left_out in LEFT_OUT] for arenas in (1, 2)]
    one = joined(*made_up[0], paths_of({"record": recorded()["summary.json"]["record"]}))
    several = joined(*made_up[1])
    differ = {path: kinds for path, kinds in several.items() if not kinds <= one.get(path, set())}
    metrics = "".join(f"{name}: {kind.unit or 'no unit'}, {kind.kind}\n" for name, kind in METRICS.items())
    return f"{lines_of(one)}# with several arenas\n{lines_of(differ)}# metrics\n{metrics}"


def _summary(left_out: str, arenas: int) -> dict[str, Any]:
    """The summary of a made-up run."""
    result = sample(Result, left_out)
    [arena] = result.arenas
    if arena.radio:
        arena = replace(arena, radio=replace(arena.radio, fates=dict.fromkeys(FATE_NAMES, 1)))
    events = tuple(replace(event, robots=event.robots * arenas) for event in result.events)
    return replace(result, arenas=(arena,) * arenas, events=events).summary()
