"""Which metrics a run measures, by what its scenario lists."""

from pathlib import Path

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.listed import Item, listed
from swarmwire.metrics.registry import METRICS, standard
from tests.support.metrics.packages import CODE, install


@pytest.fixture
def east(tmp_path: Path) -> str:
    (tmp_path / "own.py").write_text(CODE)
    return f"{tmp_path / 'own.py'}:East"


def item(spec, place=0, **params):
    return Item(f"metrics.{place}.metric" if params else f"metrics.{place}", spec, params)


def stop(spec):
    return Item("stop.metric", spec, None)


def names(*items, **options):
    return [metric.name for metric in listed(items, "s.toml", **options).metrics]


def refused(*items):
    with pytest.raises(BadInput) as caught:
        listed(items, "s.toml")
    return str(caught.value)


def test_without_a_list_the_standard_ones_are_measured():
    assert names() == standard()


def test_listed_ones_stand_behind_the_standard_ones_in_their_order(monkeypatch, east):
    monkeypatch.setattr(METRICS["order"], "standard", False)
    monkeypatch.setattr(METRICS["airtime"], "standard", False)
    assert names(item("order"), item(east, 1), item("airtime", 2)) == [*standard(), "order", "east", "airtime"]


def test_without_the_standard_ones_there_is_what_is_listed(east):
    assert names(item(east), item("order", 1), with_standard=False) == ["east", "order"]
    assert names(with_standard=False) == []


def test_a_standard_one_that_is_listed_keeps_its_place_and_takes_the_parameters():
    found = listed([item("fragmentations", hold_s=3)], "s.toml").metrics
    assert [metric.name for metric in found] == standard()
    assert METRICS["fragmentations"](hold_s=3.0) in found
    assert listed([item("order")], "s.toml") == listed([], "s.toml")


def test_a_class_takes_parameters_and_is_told_as_code(east):
    found = listed([item(east, from_m=2)], "s.toml", with_standard=False)
    assert [(metric.name, metric.from_m) for metric in found.metrics] == [("east", 2.0)]
    assert found.code == (east,)


def test_what_ends_an_arena_is_measured_once_with_the_parameters_that_are_listed(east):
    assert names(stop("order"), with_standard=False) == ["order"]
    assert names(item(east), stop("east"), with_standard=False) == ["east"]
    [only] = listed([item("fragmentations", hold_s=3), stop("fragmentations")], "", with_standard=False).metrics
    assert only == METRICS["fragmentations"](hold_s=3.0)
    assert names(stop("order"), stop("order")) == standard()


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (item("ordre"), "metrics.0: expected the name of a metric, as swarmwire list metrics tells them "
                        "(did you mean order?), or a class as module:Class or file.py:Class; got 'ordre'"),
        (item("ordre", x=1), "metrics.0.metric: expected the name of a metric, as swarmwire list metrics tells them "
                             "(did you mean order?), or a class as module:Class or file.py:Class; got 'ordre'"),
        (stop("ordr"), "stop.metric: expected the name of a metric, as swarmwire list metrics tells them "
                       "(did you mean order?); got 'ordr'"),
        (item("mine.py"), "metrics.0: expected \"package.module:Class\" or \"file.py:Class\", got 'mine.py'"),
        (item("fragmentations", hold=1), "metrics.0.hold: unknown key; expected one of hold_s (did you mean hold_s?)"),
        (item("fragmentations", hold_s=-1), "metrics.0.hold_s: expected at least 0 s, got -1.0"),
        (item("fragmentations", hold_s="x"), "metrics.0.hold_s: expected a number, got 'x'"),
        (item("order", gap_m=1), "metrics.0.gap_m: unknown key; expected none"),
    ],
)  # fmt: skip
def test_what_is_no_metric_or_does_not_fit_is_refused_with_its_key(asked, said):
    assert refused(asked) == f"s.toml: {said}"


def test_one_name_is_measured_once(east):
    twice = refused(item("order"), item("order", 1))
    assert twice == "s.toml: metrics.1: 'order' is measured already, as metrics.0 lists it"
    assert "metrics.1.metric: 'east' is measured already" in refused(item(east), item(east, 1, from_m=1))


@pytest.fixture
def site(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path / "site")
    return tmp_path / "site"


def test_a_package_brings_metrics_by_name(site):
    install(site, "compass_metrics", {"east": "East"})
    found = listed([item("east", from_m=1)], "s.toml", with_standard=False)
    assert [metric.from_m for metric in found.metrics] == [1.0]
    assert found.code == ("compass_metrics:East",)
    assert names(stop("east"), with_standard=False) == ["east"]
    assert "did you mean east?" in refused(item("eest"))


def test_a_plug_in_is_imported_only_if_it_is_asked_for(site):
    install(site, "broken_metrics", {"east": "East"}, code="raise ValueError('no such day')")
    assert names() == standard()
    said = refused(item("east"))
    assert said == "s.toml: metrics.0: broken_metrics does not import: ValueError: no such day"


def test_a_plug_in_of_another_name_or_from_two_packages_is_refused(site):
    install(site, "named_metrics", {"west": "East"})
    said = "expected named_metrics:East to have the name 'west' of its entry point; got 'east'"
    assert refused(item("west")) == f"s.toml: metrics.0: {said}"
    install(site, "more_metrics", {"west": "East"})
    assert refused(item("west")).endswith("expected one plug-in 'west'; more than one package brings it")


def test_a_name_of_swarmwires_own_stays_its_own(site):
    install(site, "taken_metrics", {"order": "East"})
    assert type(listed([item("order")], "s.toml", with_standard=False).metrics[0]) is METRICS["order"]
