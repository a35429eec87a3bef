"""Success tables: straight lines in dB between what was measured; refused unless they rise."""

import math

import pytest

from swarmwire.comms.air.decibels import from_db
from swarmwire.comms.air.parameters.reception import SuccessTable, refuse_unless_rising
from swarmwire.comms.air.reception.receiver import by_table, chunk_success
from swarmwire.comms.errors import BadInput

MEASURED = SuccessTable((-94.0, -93.0, -90.0), (0.4, 0.6, 0.86), 800)


def test_a_table_gives_its_rows_a_straight_line_between_and_the_ends_beyond():
    receiver = by_table(MEASURED)
    for sinr_db, success in ((-94, 0.4), (-93.5, 0.5), (-93, 0.6), (-91.5, 0.73), (-90, 0.86), (-200, 0.4), (50, 0.86)):
        assert chunk_success(receiver, from_db(sinr_db), 800) == pytest.approx(success, rel=1e-12)
    assert chunk_success(receiver, 0.0, 800) == 0.4
    assert chunk_success(receiver, from_db(-93.5), 1600) == pytest.approx(0.25, rel=1e-12)


@pytest.mark.parametrize(
    ("sinr_db", "success", "key"),
    [
        ((0.0, 1.0, 1.0), (0.1, 0.2, 0.3), "sinr_db"),
        ((0.0, 2.0, 1.0), (0.1, 0.2, 0.3), "sinr_db"),
        ((0.0, 1.0, 2.0), (0.1, 0.3, 0.2), "success"),
        ((0.0, 1.0), (0.1, 1.1), "success"),
        ((0.0, 1.0), (-0.1, 1.0), "success"),
        ((0.0, 1.0), (0.1,), "success"),
        ((0.0,), (0.1,), "success"),
        ((0.0, math.nan), (0.1, 0.2), "sinr_db"),
    ],
)
def test_a_table_that_does_not_rise_is_refused(sinr_db, success, key: str):
    with pytest.raises(BadInput) as refused:
        refuse_unless_rising(SuccessTable(sinr_db, success, 100), "a.toml", "radio.reception")
    assert refused.value.key == f"radio.reception.{key}"


def test_a_table_that_rises_is_taken():
    refuse_unless_rising(MEASURED, "a.toml", "radio.reception")
