"""What all parts use: errors, texts of users, plain values, tables of sheets, kernels for kernels."""

import json
import tomllib
from dataclasses import dataclass
from datetime import date

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms import errors
from swarmwire.comms.bodies.tables import built
from swarmwire.comms.config import check_plain, from_json, from_toml, parameter
from swarmwire.comms.errors import BadInput
from swarmwire.comms.radio.phy.event_queue import SEND, event_queue, schedule


def test_bad_input_is_a_line_that_a_terminal_can_show_whatever_was_given() -> None:
    error = errors.BadInput(
        "flock.toml", "robots.\x1b[31m\n\u202e", f"expected a name, got {'x' * 5000}, did you mean y"
    )
    assert str(error).startswith("flock.toml: robots.\\x1b[31m\\n\\u202e: expected a name, got xxx")
    assert str(error).endswith("xxx, did you mean y")
    assert str(error).isprintable()
    assert len(str(error)) < 1600
    assert error.key == "robots.\x1b[31m\n\u202e", "what programs look at stays as it was"


def test_what_is_sound_is_read() -> None:
    assert from_json('{"a": [1, 2.5]}') == from_toml("a = [1, 2.5]")


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "1" * 5000, b"\xff"], ids=lambda text: str(text[:9]))
def test_what_is_no_json_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError):
        from_json(text)


@pytest.mark.parametrize("value", ["", "[" * 100_000, "1" * 5000, "2026-02-31"], ids=lambda text: text[:9])
def test_what_is_no_toml_is_told_as_such(value: str) -> None:
    with pytest.raises(tomllib.TOMLDecodeError):
        from_toml(f"a = {value}")


SINGLE = st.booleans() | st.text() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False, allow_infinity=False)
PLAIN = st.recursive(SINGLE, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=10)


@given(PLAIN)
def test_what_passes_can_be_written_and_read(value):
    check_plain(value, "robot.toml", "params")
    assert json.loads(json.dumps(value)) == value
    assert msgpack.unpackb(msgpack.packb(value)) == value


@pytest.mark.parametrize(
    ("value", "key"),
    [
        ({"at": date(2026, 11, 21)}, "params.at"),
        ({"of": [1, {"x": float("inf")}]}, "params.of[1].x"),
        ([2**64], "params[0]"),
        (None, "params"),
        ({1: 2}, "params.1"),
    ],
)
def test_what_does_not_is_named(value, key):
    with pytest.raises(BadInput) as refused:
        check_plain(value, "robot.toml", "params")
    assert (refused.value.where, refused.value.key) == ("robot.toml", key)


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
    ("table", "key"),
    [
        ([], "nose"),
        ({}, "nose.kind"),
        ({"kind": "cold"}, "nose.kind"),
        ({"kind": "dry", "size": 1}, "nose.size"),
        *(({"kind": "dry", "cut_m": value}, "nose.cut_m") for value in ("far", True, -1)),
        ({"kind": "dry", "curve": {"reach_m": 0}}, "nose.curve.reach_m"),
    ],
)
def test_what_does_not_fit_is_refused_by_its_key(table, key):
    with pytest.raises(BadInput) as caught:
        built(Nose, table, "sheet", "nose")
    assert (caught.value.where, caught.value.key) == ("sheet", key)


@pytest.mark.skipif(not hasattr(schedule, "overloads"), reason="kernels are plain Python: anybody can call them")
def test_a_kernel_for_kernels_refuses_to_be_called_by_python() -> None:
    queue = event_queue(1)
    with pytest.raises(TypeError, match="schedule: expected a call by another kernel"):
        schedule(queue, SEND, 0, 5)
    assert queue.size[0] == 0
