"""What events changed, in the report of a run."""

import polars as pl
import pytest

from swarmwire.metrics.pictures.report.run_data import event_kind, lanes_of, with_details

SCENARIO = """
[radio]
loss = 0.1

[[events]]
at_s = 5.0
do = "ramp"
what = "radio.loss"
to = 0.4
over_s = 2.0

[[events]]
at_s = 9.0
do = "ramp"
what = "radio.loss"
to = 0.0
for_s = 3.0

[[events]]
at_s = 9.0
do = "kill"
robots = { count = 1 }

[[events]]
at_s = 9.0
do = "jammer"
power_dbm = -10.0
at = [0.0, 3.0]
"""


def row(at_s, do, ended=False, robots=()):
    return {"at_s": at_s, "time_s": at_s, "do": do, "part": "", "ended": ended, "robots": list(robots)}


ROWS = [
    row(5.0, "ramp"),
    row(9.0, "ramp"),
    row(9.0, "kill", robots=["flock-3"]),
    row(9.0, "jammer"),
    row(9.0, "ramp", ended=True) | {"time_s": 12.0},
    row(20.0, "kill", robots=["flock-1"]),  # submitted while it ran
]


def test_events_name_the_number_that_they_change_and_from_where_to_where():
    events = with_details(pl.DataFrame(ROWS), SCENARIO)
    assert [event_kind(one) for one in events.iter_rows(named=True)] == [
        "ramp radio.loss from 0.1 to 0.4 over 2 s",
        "ramp radio.loss from 0.4 to 0.0 for 3 s",
        "kill",
        "jammer power_dbm -10.0, at 0.0 3.0",
        "ramp radio.loss from 0.4 to 0.0 for 3 s",
        "kill",
    ]


def test_lanes_of_events_with_details_keep_their_ends():
    lanes = {lane.kind: lane.spans for lane in lanes_of(with_details(pl.DataFrame(ROWS), SCENARIO))}
    [span] = lanes["ramp radio.loss from 0.4 to 0.0 for 3 s"]
    assert (span.from_s, span.until_s) == (9.0, 12.0)
    assert len(lanes["kill"]) == 2


@pytest.mark.parametrize("text", ["", "[[events", "name = 'x'"])
def test_events_without_a_scenario_have_no_details(text):
    events = with_details(pl.DataFrame(ROWS), text)
    assert event_kind(events.row(0, named=True)) == "ramp"
