"""A table becomes the dataclass that describes it, or is refused by its key."""

from dataclasses import dataclass

import pytest

from swarmwire.comms.bodies.tables import built
from swarmwire.comms.errors import BadInput
from swarmwire.comms.parameters import parameter


@dataclass(frozen=True)
class Curve:
    reach_m: float = parameter(1.0, help="where it ends", unit="m", above=0)


@dataclass(frozen=True)
class Nose:
    kind: str = parameter(help="of which make", choices=("dry", "wet"))
    curve: Curve = parameter(Curve(), help="its answer")
    cut_m: float | None = parameter(None, help="beyond it smells nothing", unit="m", above=0)


def test_a_table_is_built_with_the_defaults_of_what_it_leaves_out():
    assert built(Nose, {"kind": "wet"}, "sheet", "nose") == Nose("wet", Curve(1.0))
    assert built(Nose, {"kind": "dry", "curve": {"reach_m": 2}}, "sheet", "nose") == Nose("dry", Curve(2.0))
    assert built(Nose, {"kind": "dry", "cut_m": 3}, "sheet", "nose") == Nose("dry", cut_m=3.0)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ([], "nose: expected a table"),
        ({}, "nose.kind: "),
        ({"kind": "cold"}, "nose.kind: "),
        ({"kind": "dry", "size": 1}, "nose.size: unknown key; expected one of kind, curve, cut_m"),
        ({"kind": "dry", "cut_m": "far"}, "nose.cut_m: expected a number, got 'far'"),
        ({"kind": "dry", "cut_m": True}, "nose.cut_m: expected a number, got True"),
        ({"kind": "dry", "cut_m": -1}, "nose.cut_m: expected more than 0 m, got -1.0"),
        ({"kind": "dry", "curve": {"reach_m": 0}}, "nose.curve.reach_m: expected more than 0 m, got 0"),
    ],
)
def test_what_does_not_fit_is_refused_by_its_key(table, said):
    with pytest.raises(BadInput) as caught:
        built(Nose, table, "sheet", "nose")
    assert str(caught.value).startswith(f"sheet: {said}")
