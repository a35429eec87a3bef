"""A field of a custom sensor that cannot be is refused at the door; one that can is not."""

import re
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from swarmwire.comms.bodies.body import body_from
from swarmwire.comms.errors import BadInput
from swarmwire.world.custom import Field, Noise
from swarmwire.world.scenario.bodies import fitted
from tests.support.world import custom_code

UNKNOWN: Any = "gaussian"
SHEET: dict[str, Any] = {"like": "epuck", "sensors": {"x": {"kind": "tests.support.world.custom_code:Alone"}}}


def fit(monkeypatch: pytest.MonkeyPatch, *fields: Field) -> dict[str, int]:
    """The fields that agents are told of, of a custom sensor with these."""
    monkeypatch.setattr(custom_code.Alone, "fields", fields)
    spec: Any = fitted(body_from(SHEET, "mine.toml"), "mine.toml").sensors["x"]
    return spec.fields


@pytest.mark.parametrize(
    ("of", "said"),
    [
        ({"step": nan}, "expected step as a finite number from 0; got nan"),
        ({"step": -0.1}, "expected step as a finite number from 0; got -0.1"),
        ({"step": "0.1"}, "expected step as a finite number from 0; got '0.1'"),
        ({"step": True}, "expected step as a finite number from 0; got True"),
        ({"low": 1.0, "high": 0.5}, "expected low not above high; got 1.0 and 0.5"),
        ({"low": nan}, "expected low as a number; got nan"),
        ({"high": None}, "expected high as a number; got None"),
        ({"blank": None}, "expected blank as a number; got None"),
        ({"noise": 0.1}, "expected noise as a Noise; got 0.1"),
        ({"noise": Noise(kind=UNKNOWN)}, "expected noise of the kind uniform or normal; got 'gaussian'"),
        ({"noise": Noise(size=-1.0)}, "expected noise.size as a finite number from 0; got -1.0"),
        ({"noise": Noise(relative=inf)}, "expected noise.relative as a finite number from 0; got inf"),
        ({"width": -1}, "expected a width from 0 to 10000; got -1"),
        ({"width": 1.5}, "expected a width from 0 to 10000; got 1.5"),
        ({"span": (1.0, 0.0)}, "expected span as two finite numbers that do not fall; got (1.0, 0.0)"),
        ({"span": (0.0, inf)}, "expected span as two finite numbers that do not fall; got (0.0, inf)"),
        ({"unit": 1}, "expected unit as a text; got 1"),
        ({"help": None}, "expected help as a text; got None"),
        ({"per": 2.0}, "expected per as a text; got 2.0"),
        ({"span": 3}, "expected span as two finite numbers that do not fall; got 3"),
    ],
)
def test_a_field_that_cannot_be_is_refused(monkeypatch: pytest.MonkeyPatch, of: dict[str, Any], said: str) -> None:
    with pytest.raises(BadInput, match=f"^mine.toml: sensors.x.kind: the field b of Alone: {re.escape(said)}$"):
        fit(monkeypatch, Field("a"), Field("b", **of))


@pytest.mark.parametrize("name", ["", "a b", 3])
def test_a_field_has_a_name(monkeypatch: pytest.MonkeyPatch, name: Any) -> None:
    with pytest.raises(BadInput, match="expected fields with names of their own, of letters, digits and _; got a, "):
        fit(monkeypatch, Field("a"), Field(name))


def test_fields_at_their_limits_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    noise: Any = Noise("uniform", 0, np.float32(0.5))
    told = fit(monkeypatch, Field("a", 2, noise, 0, -inf, 1, blank=-1), Field("b", low=1.0, high=1.0, span=(0, 0)))
    assert told == {"a": 2, "b": 0}
