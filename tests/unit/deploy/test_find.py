"""What is to be described is found by its name, short or long; and who names nothing is told what to try."""

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.deploy.catalogue.find import find
from swarmwire.deploy.catalogue.kinds import KINDS
from swarmwire.metrics.registry import METRICS
from swarmwire.metrics.swarm.order import Order
from tests.support.deploy.commands import LOSSY, called


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
def test_each_kind_finds_its_own(kind):
    entry = kind.entries()[-1]
    assert find(f"{kind.one}:{entry.name}") == find(f"{kind.name}:{entry.name}") == entry


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ("ORDER", "order"),
        ("loss", "radio.loss"),
        ("robots.flock.count", "robots.*.count"),
        ("arena.obstacles.0.shape", "arena.obstacles.*.shape"),
        ("robots.flock", "robots.*"),
        ("events:kill", "kill"),
    ],
)
def test_a_name_may_be_short_or_that_of_ones_own_group(asked, name):
    assert find(asked).name == name


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("flokking", "nothing has this name; nearest: Flocking"),
        ("radio.los", "nearest: radio.loss"),
        ("latencys", "nearest: radio.latency_s"),
        ("metric:kill", "nothing has this name"),
        ("xyzzy", "nothing is near it"),
        ("blackout", "say which: event:blackout, fate:blackout"),
        ("size_m", "say which: arena.size_m, arena.obstacles.*.within.size_m"),
        ("fates", "swarmwire list fates"),
        ("absent.toml", "expected a readable file"),
        ("absent.py:Mine", "there is no file"),
        ("absent.py", "expected the class in it, too: absent.py:Class"),
        (str(LOSSY), "expected a body's sheet, got a scenario; swarmwire check and draw take one"),
        ("swarmwire.agent:Robot", "no Agent or VectorAgent"),
    ],
)
def test_a_name_that_leads_nowhere_or_to_several_things_says_what_to_try(asked, expected):
    with pytest.raises(BadInput) as refused:
        find(asked)
    assert str(refused.value).startswith(f"{asked}: ")
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_metric_of_ones_own_is_there_once_it_is_registered(monkeypatch):
    class Mine(Order):
        """Order, as I see it."""

        name = "mine"
        help = "order, as I see it"

    monkeypatch.setitem(METRICS, "mine", Mine)
    assert find("mine").help == "order, as I see it"


def test_a_name_that_there_is_not_gets_one_line_and_exit_code_2(monkeypatch, capsys):
    code, out, errors = called(monkeypatch, capsys, "describe", "flokking")
    assert (code, out) == (2, "")
    assert errors.startswith("error: flokking: ")
    assert errors.count("\n") == 1
