"""What a scenario asks to be measured, and the conditions that end its arenas, are checked at the door."""

from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.world.scenario.scenario import mapping_of
from swarmwire.world.scenario.tables import MetricTable
from swarmwire.world.scenario_file import scenario_from
from tests.support.world.samples import changed

FAULTS: list[tuple[str, Any, str]] = [
    ("standard_metrics", 1, "standard_metrics"),
    ("metrics", "order", "metrics"),
    ("metrics", ["order", 5], "metrics.1"),
    ("metrics", [""], "metrics.0"),
    ("metrics", [{"gap_m": 1}], "metrics.0.metric"),
    ("stop", 3, "stop"),
    ("stop", [3], "stop.0"),
    ("stop", {"above": 1}, "stop.metric"),
    ("stop", {"metric": "order"}, "stop"),
    ("stop", [{"metric": "order", "above": 1, "below": 2}], "stop.0"),
    ("stop", {"metric": "order", "above": "x"}, "stop.above"),
    ("stop", {"metric": "order", "abov": 1}, "stop.abov"),
    ("stop", [{"metric": "order", "above": 1, "hold_s": -1}], "stop.0.hold_s"),
]


@pytest.mark.parametrize(("path", "value", "key"), FAULTS)
def test_a_fault_of_what_is_measured_is_refused_with_its_key(path: str, value: Any, key: str) -> None:
    with pytest.raises(BadInput) as caught:
        scenario_from(changed(path, value), "file.toml")
    assert (caught.value.where, caught.value.key) == ("file.toml", key)


def test_a_condition_that_ends_arenas_is_a_table_or_a_list_of_tables_and_may_be_none() -> None:
    order = {"metric": "order", "at_least": 1, "hold_s": 2}
    [(path, table)] = scenario_from(changed("stop", order), "file.toml").stops().items()
    assert (path, table.metric, table.comparison, table.hold_s) == ("stop", "order", ("at_least", 1.0), 2.0)
    assert list(scenario_from(changed("stop", [order, order]), "file.toml").stops()) == ["stop.0", "stop.1"]
    assert scenario_from(changed("stop", []), "file.toml").stops() == {}
    assert scenario_from(changed("stop", order), "file.toml", ["stop=[]"]).stops() == {}


def test_a_metrics_parameters_stand_beside_its_name_and_can_be_set() -> None:
    given = changed("metrics", ["order", {"metric": "fragmentations", "hold_s": 2.0}])
    scenario = scenario_from(given, "file.toml", ["metrics.1.hold_s=3.0"])
    assert scenario.metrics == ("order", MetricTable(metric="fragmentations", hold_s=3.0))
    assert [item.params for item in scenario.metrics if isinstance(item, MetricTable)] == [{"hold_s": 3.0}]
    again = mapping_of(scenario.model_copy(update={"duration_s": 2.0}))
    assert again["metrics"] == ["order", {"metric": "fragmentations", "hold_s": 3.0}]
