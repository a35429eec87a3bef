"""Campaigns side by side: which points meet, what is said of them, and what is refused."""

import csv
import math

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.campaign.compare import COLUMNS, cells, compare, notes, write_comparison
from swarmwire.metrics.campaign.folder import at, select
from swarmwire.metrics.campaign.spec import same_value, value_from
from tests.support.metrics.campaigns import NUMBERS, TIMES, order, write_campaign

TWO = {"radio.loss": [0.0, 0.1], "physics.engine": ["discs", "pymunk"]}


@pytest.fixture
def plain(tmp_path):
    return write_campaign(tmp_path / "plain")


@pytest.fixture
def better(tmp_path):
    """The same, with 0.1 more order, other draws, and one more loss."""
    numbers = NUMBERS | {"order.final": lambda point, rng: order(point, rng) + 0.1}
    return write_campaign(tmp_path / "better", {"radio.loss": [0.1 + 0.3, 0.2, 0.6]}, numbers=numbers, draws=1)


def compared(first, second, *responses, where=()):
    return compare(*at([select(str(first)), select(str(second))], where), responses)


def test_points_that_both_have_meet_whatever_their_order(plain, better):
    found = compared(plain, better, "order")
    assert [(row.first_point["radio.loss"], row.second_point["radio.loss"]) for row in found.rows] == [
        (0.2, 0.2),
        (0.4, 0.4),
    ]
    assert found.paths == ("radio.loss",)
    for row in found.rows:
        assert row.difference.pairs == 10
        assert row.difference.median == pytest.approx(0.1, abs=0.06)
        assert row.difference.delta > 0.5
        assert row.second.q50 > row.first.q50


def test_times_and_last_values_are_compared_unless_others_are_named(plain, better):
    columns = [row.response.column for row in compared(plain, better, where=["radio.loss=0.2"]).rows]
    assert columns == ["order.final", "radio.link_pdr", "aggregation_time_s"]
    assert [row.response.column for row in compared(plain, better, "counts.late_answers").rows] == [
        "counts.late_answers"
    ] * 2


def test_what_neither_has_a_value_of_is_left_out_unless_named(tmp_path, plain):
    folders = [
        write_campaign(tmp_path / name, numbers=NUMBERS | {"gap_m.final": lambda *_: None}, seeds=(1, 2))
        for name in "ab"
    ]
    assert "gap_m.final" not in {row.response.column for row in compared(*folders).rows}
    (row, *_) = compared(*folders, "gap_m").rows
    assert (row.first.n, row.first.undefined) == (0, 2)
    none = write_campaign(tmp_path / "none", missing=range(30))
    with pytest.raises(BadInput, check=lambda error: error.where == f"{none}, {none}"):
        compared(none, none)


def test_two_parts_of_one_campaign_meet_where_they_were_chosen(plain):
    found = compared(f"{plain}@radio.loss=0", f"{plain}@radio.loss=0.4", "order.final")
    assert found.paths == ()
    (row,) = found.rows
    assert (row.first_point["radio.loss"], row.second_point["radio.loss"]) == (0.0, 0.4)
    assert row.difference.median < -0.15
    assert cells(found, row)[1] == "A: radio.loss=0; B: radio.loss=0.4"


def test_what_only_one_varies_is_told_beside_it(tmp_path, plain):
    both = write_campaign(tmp_path / "both", TWO)
    found = compared(both, f"{plain}@radio.loss=0", "order")
    assert cells(found, found.rows[0])[1] == "A: radio.loss=0, physics.engine=discs; B: radio.loss=0"
    found = compared(both, plain, "order")
    assert [cells(found, row)[1] for row in found.rows] == [
        "radio.loss=0; A: physics.engine=discs",
        "radio.loss=0; A: physics.engine=pymunk",
    ]
    assert len(compared(both, plain, "order", where=["physics.engine=discs"]).rows) == 1


def test_campaigns_that_vary_nothing_have_one_point(tmp_path):
    folders = [write_campaign(tmp_path / name, {}, points=[{}]) for name in "ab"]
    found = compared(*folders, "order")
    assert [cells(found, row)[1] for row in found.rows] == ["all"]


def test_the_table_says_how_many_failed_are_missing_and_what_it_shows(tmp_path, plain):
    part = write_campaign(tmp_path / "part", failed=(0, 1), missing=(25,), parts=1)
    found = compared(plain, part)
    told = "\n".join(notes(found))
    assert all(text in told for text in (f"A: {plain} (30 ", f"B: {part} (", "29 of 30", "2 failed", "95 %"))
    assert [len(cells(found, row)) for row in found.rows] == [len(COLUMNS)] * 9
    assert cells(found, found.rows[0])[-1] == "8"


def test_samples_without_a_seed_in_common_are_said_to_be(tmp_path, plain):
    other = write_campaign(tmp_path / "other", seeds=range(50, 60))
    found = compared(plain, other, "aggregation_time_s", "order", where=["radio.loss=0"])
    assert [cells(found, row)[-1] for row in found.rows] == ["none (10, 10)"] * 2
    assert [row.difference.test for row in found.rows] == ["log-rank", "Mann-Whitney"]


def test_the_table_for_programs_has_the_numbers_of_the_rows(tmp_path, plain, better):
    never = write_campaign(tmp_path / "never", times={"aggregation_time_s": lambda *_: None})
    found = compared(never, better)
    write_comparison(found, tmp_path / "x.csv")
    rows = list(csv.DictReader((tmp_path / "x.csv").read_text().splitlines()))
    assert len(rows) == len(found.rows)
    assert rows[0]["response"] == "order.final"
    assert float(rows[0]["median_difference"]) == found.rows[0].difference.median
    assert rows[0]["a.radio.loss"] == rows[0]["b.radio.loss"] == "0.2"
    last = rows[-1]
    assert (last["kind"], last["a_censored"], last["a_q50"], last["a_limit"]) == ("time", "1.0", "", "100.0")
    assert last["median_difference_low"] == "-inf"
    assert math.isnan(found.rows[-1].first.q50)


@pytest.mark.parametrize("name", ["x.txt", "nowhere/x.csv"])
def test_a_path_that_takes_no_table_is_refused(tmp_path, plain, name):
    with pytest.raises(BadInput):
        write_comparison(compared(plain, plain), tmp_path / name)


def test_a_folder_whose_name_has_an_at_is_a_folder(tmp_path):
    folder = write_campaign(tmp_path / "a@b=c")
    assert len(select(str(folder)).points) == 3


@pytest.mark.parametrize(
    ("first", "second", "where", "key", "hint"),
    [
        ("plain", "other", [], "", "vary"),
        ("plain", "far", [], "", "points"),
        ("plain", "strange", [], "", "responses"),
        ("plain", "nothing", [], "", "none"),
        ("plain@radio.los=0", "plain", [], "radio.los", "radio.loss (did you mean this?)"),
        ("plain@radio.loss=0.3", "plain", [], "radio.loss", "0, 0.2, 0.4"),
        ("plain@radio.loss", "plain", [], "radio.loss", "="),
        ("plain", "plain", ["radio.los=0"], "radio.los", "--at: "),
        ("plain", "plain", ["radio.loss=9"], "radio.loss", "0, 0.2, 0.4"),
        ("plain", "plain", ["radio.loss="], "radio.loss=", "="),
    ],
)
def test_what_cannot_be_compared_is_refused_with_its_key(tmp_path, plain, first, second, where, key, hint):
    write_campaign(tmp_path / "other", {"physics.engine": ["discs", "pymunk"]})
    write_campaign(tmp_path / "far", {"radio.loss": [0.9]})
    write_campaign(tmp_path / "strange", numbers={"gap_m.final": lambda *_: 1.0}, times={})
    with pytest.raises(BadInput) as refused:
        compared(tmp_path / first, tmp_path / second, where=where)
    assert refused.value.key == key
    assert hint in str(refused.value)


def test_responses_of_another_kind_are_not_the_same(tmp_path, plain):
    other = write_campaign(tmp_path / "other", numbers=NUMBERS | TIMES, times={})
    with pytest.raises(BadInput, match="aggregation_time_s"):
        compared(plain, other, "aggregation_time_s")


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        (0.1 + 0.2, 0.3, True),
        (1, 1.0, True),
        (1, True, False),
        (True, True, True),
        ("a", "a", True),
        ("1", 1, False),
        (None, None, True),
        ([1, 2], [1, 2], True),
    ],
)
def test_values_are_the_same_but_for_rounding(one, other, same):
    assert same_value(one, other) is same
    assert same_value(other, one) is same


@pytest.mark.parametrize(
    ("text", "value"), [("[1, 2]", [1, 2]), ('"a b"', "a b"), ("a b", "a b"), ("1\nb = 2", "1\nb = 2")]
)
def test_values_are_written_as_in_a_scenario_or_as_they_are(text, value):
    assert value_from(text) == value
