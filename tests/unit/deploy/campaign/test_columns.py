"""The table of all runs."""

from types import SimpleNamespace

from swarmwire.deploy.campaign.columns import Columns


def test_of_a_run_with_several_rows_the_last_counts():
    columns = Columns(SimpleNamespace(points=[{}], vary={}, responses=()))
    rows = [{"run": 0, "point": 0, "seed": 1, "ended": ended} for ended in ("failed", "duration")]
    assert columns.joined(columns.frame([row]) for row in rows)["ended"].to_list() == ["duration"]
