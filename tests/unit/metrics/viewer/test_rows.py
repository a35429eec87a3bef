"""Rows that wait to be sent: how much they are, and that one entity's fault is not another's."""

import numpy as np
import pytest

from swarmwire.metrics.viewer.rows import ROW_BYTES, RerunRows


class SentPackets:
    """A recording that notes what it is sent."""

    def __init__(self):
        self.rows = {}

    def send_columns(self, entity, index, columns):
        self.rows[entity] = columns


class Columns:
    """Columns of one field, in which rows can be counted."""

    def __init__(self, values):
        self.values = values

    def partition(self, lengths):
        return lengths


def refused(values):
    raise ValueError(f"no columns of {len(values)}")


@pytest.mark.parametrize(
    ("fields", "least", "most"),
    [
        ({"a": np.zeros((100, 3), np.float32)}, 1200, 1200),
        ({"a": np.zeros((10, 2)), "b": np.zeros(10, np.uint32)}, 200, 200),
        ({"a": [np.zeros((49, 2)), np.zeros((5, 2))]}, 54 * 16, 54 * 16),
        ({"a": ["x" * 5000]}, 5000, 5100),
        ({"a": []}, 0, 0),
    ],
)
def test_what_waits_is_counted_in_all_fields_whatever_holds_them(fields, least, most):
    rows = RerunRows(SentPackets())
    for tick in range(3):
        rows.begin_tick(tick, tick)
        rows.add("entity", Columns, **fields)
    assert 3 * least <= rows.kept_bytes - 3 * ROW_BYTES <= 3 * most


def test_an_entity_that_fails_takes_no_other_with_it_and_is_told():
    pytest.importorskip("rerun", reason="needs the extra [view]")
    rec = SentPackets()
    rows = RerunRows(rec)
    for tick in range(2):
        rows.begin_tick(tick, tick)
        for entity, columns in (("before", Columns), ("bad", refused), ("worse", refused), ("after", Columns)):
            rows.add(entity, columns, values=np.zeros(3 if entity == "bad" else 4))
    with pytest.raises(ValueError, match="no columns of 6"):
        rows.send()
    assert rec.rows == {"before": [4, 4], "after": [4, 4]}
    rows.send()  # what failed is not tried again
    assert rows.kept_bytes == 0
