"""Configuration, errors, clocks, and extras."""

import json
import time
import tomllib
from copy import copy
from dataclasses import dataclass
from datetime import date
from importlib.metadata import metadata
from itertools import count

import msgpack
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base import errors, extras
from swarmwire.comms.base.clock import NS_PER_S, PreciseClock, ScaledClock, WallClock, tick_start_ns, to_ns, to_s
from swarmwire.comms.base.config import check_plain, from_json, from_toml, parameter
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.extras import Extra
from swarmwire.comms.robot.bodies.tables import parse_table
from swarmwire.comms.wire.assignment import robots_text
from tests.support.clocks import FakeClock
from tests.support.refusals import refused_input

SINGLE = st.booleans() | st.text() | st.integers(-(2**63), 2**64 - 1) | st.floats(allow_nan=False, allow_infinity=False)
PLAIN = st.recursive(SINGLE, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner), max_leaves=10)
TICKS = st.integers(0, 10**9)
RATES = st.integers(1, 10_000)
ALL = [extra for extra in vars(extras).values() if isinstance(extra, Extra)]


def test_bad_input_message_is_printable_and_bounded_with_any_key() -> None:
    error = errors.BadInput(
        "flock.toml", "robots.\x1b[31m\n\u202e", f"expected a name, got {'x' * 5000}, did you mean y"
    )
    assert str(error).startswith("flock.toml: robots.\\x1b[31m\\n\\u202e: expected a name, got xxx")
    assert str(error).endswith("xxx, did you mean y")
    assert str(error).isprintable()
    assert len(str(error)) < 1600
    assert error.key == "robots.\x1b[31m\n\u202e", "what programs look at stays as it was"


@pytest.mark.parametrize(
    "error",
    [
        BadInput("flock.toml", "robots", "expected a table"),
        errors.AgentFailed("flock-0", "ValueError: 3"),
        errors.RunnerLost("runner", "", "it ended"),
        errors.BadFrame("short", "3 bytes"),
        errors.RecordFailed("the disk is full"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_errors_survive_a_copy_with_message_and_attributes(error: errors.SwarmwireError) -> None:
    twin = copy(error)  # as pickle copies: by `__reduce_ex__`
    assert (type(twin), str(twin), vars(twin)) == (type(error), str(error), vars(error))


@pytest.mark.parametrize(
    ("robots", "text"),
    [
        ("", ""),
        ("r0", "r0"),
        ("r0 r1 r2", "r0, r1, r2"),
        ("r0 r1 r2 r4 r5 r6 r7", "r0 … r2, r4 … r7 (7 robots)"),
        ("r9 r10 r11 s12 s13", "r9 … r11, s12, s13 (5 robots)"),
        ("r3 r2 r1 r0", "r3, r2, r1, r0 (4 robots)"),
        ("a0/r0 a0/r1 a1/r0 a1/r1", "a0/r0, a0/r1, a1/r0, a1/r1 (4 robots)"),
        (" ".join(f"r{n}" for n in range(0, 20, 2)), "r0, r2, r4, r6, r8, r10, r12, r14, and 2 more (10 robots)"),
        (" ".join(["1" * 5000] * 4), ", ".join(["1" * 5000] * 4) + " (4 robots)"),
    ],
    ids=lambda text: text[:30],
)
def test_robots_text_lists_names_or_spans(robots: str, text: str) -> None:
    assert robots_text(robots.split()) == text


def test_json_and_toml_are_read_alike() -> None:
    assert from_json('{"a": [1, 2.5]}') == from_toml("a = [1, 2.5]")
    for value in ("", "[" * 100_000, "1" * 5000, "2026-02-31"):
        with pytest.raises(tomllib.TOMLDecodeError):
            from_toml(f"a = {value}")
    for text in ("", "{", "[" * 100_000, "1" * 5000, b"\xff"):
        with pytest.raises(ValueError):
            from_json(text)


@given(PLAIN)
def test_plain_value_survives_json_and_msgpack(value):
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
def test_value_that_is_not_plain_is_refused_by_its_key(value, key):
    with refused_input("robot.toml", key):
        check_plain(value, "robot.toml", "params")


@dataclass(frozen=True)
class Curve:
    reach_m: float = parameter(1.0, help="where it ends", unit="m", above=0)


@dataclass(frozen=True)
class Nose:
    kind: str = parameter(help="of which make", choices=("dry", "wet"))
    curve: Curve = parameter(Curve(), help="its answer")
    cut_m: float | None = parameter(None, help="beyond it smells nothing", unit="m", above=0)


def test_table_parses_with_defaults_of_missing_keys():
    assert parse_table(Nose, {"kind": "wet"}, "sheet", "nose") == Nose("wet", Curve(1.0))
    assert parse_table(Nose, {"kind": "dry", "curve": {"reach_m": 2}}, "sheet", "nose") == Nose("dry", Curve(2.0))
    assert parse_table(Nose, {"kind": "dry", "cut_m": 3}, "sheet", "nose") == Nose("dry", cut_m=3.0)


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
def test_table_that_does_not_fit_is_refused_by_its_key(table, key):
    with refused_input("sheet", key):
        parse_table(Nose, table, "sheet", "nose")


@given(TICKS, RATES)
def test_tick_starts_at_its_exact_time_rounded_down(tick: int, rate_hz: int) -> None:
    start_ns = tick_start_ns(tick, rate_hz)
    assert start_ns * rate_hz <= tick * NS_PER_S < (start_ns + 1) * rate_hz
    assert tick_start_ns(tick * rate_hz, rate_hz) == tick * NS_PER_S
    assert tick_start_ns(tick + 1, rate_hz) - start_ns in {NS_PER_S // rate_hz, NS_PER_S // rate_hz + 1}


@given(st.integers(0, 10**15))
def test_nanoseconds_survive_conversion_to_seconds(ns: int) -> None:
    """Up to eleven days, beyond which a float of seconds no longer tells single nanoseconds apart safely."""
    assert to_ns(to_s(ns)) == ns
    assert [to_ns(0.1), to_ns(0.3), to_ns(1e-9), to_ns(0.4e-9)] == [100_000_000, 300_000_000, 1, 0]


class LateClock(FakeClock):
    """A clock whose sleeps end late, and on which looking takes time."""

    def __init__(self, late_ns: int) -> None:
        super().__init__()
        self.late_ns = late_ns

    def now_ns(self) -> int:
        self.time_ns += 100
        return self.time_ns

    def sleep_until(self, at_ns: int) -> None:
        super().sleep_until(at_ns)
        self.time_ns += self.late_ns


def test_precise_clock_corrects_late_wake_ups() -> None:
    inner = LateClock(250_000)
    clock, late_ns = PreciseClock(inner), list[int]()
    for _ in range(4):
        at_ns = inner.time_ns + 10_000_000
        clock.sleep_until(at_ns)
        late_ns.append(inner.time_ns - at_ns)
    assert late_ns[0] > 100_000  # not known yet
    assert all(0 <= late < 1_000 for late in late_ns[1:])
    inner.late_ns = 0
    for _ in range(100):
        clock.sleep_until(inner.time_ns + 10_000_000)
    assert clock._wake_latency_ns < 10_000  # it does not wait awake for long where sleeps end on time


def test_precise_clock_limits_its_busy_wait() -> None:
    inner = LateClock(50_000_000)
    clock = PreciseClock(inner)
    clock.sleep_until(inner.time_ns - 5)
    clock.sleep_until(inner.time_ns + 20_000)
    assert not inner.slept_until
    clock.sleep_until(inner.time_ns + 10_000_000)
    assert clock._wake_latency_ns <= 500_000


class DatedClock(FakeClock):
    """A clock that shows a date besides."""

    date_ns = 1_800_000_000 * NS_PER_S

    def utc_ns(self) -> int:
        return self.date_ns + self.time_ns


def test_scaled_clock_runs_and_sleeps_by_its_factor() -> None:
    wall = DatedClock()
    clock = ScaledClock(wall, 4.0)
    began_ns, date_ns = wall.time_ns, clock.utc_ns()
    clock.sleep_until(2 * NS_PER_S)
    assert wall.time_ns - began_ns == NS_PER_S // 2
    assert clock.now_ns() == 2 * NS_PER_S
    assert abs(clock.utc_ns() - date_ns - 2 * NS_PER_S) < 1000  # what a float of a date rounds off


@given(st.floats(0.01, 1000.0), st.integers(0, 50 * 365 * 86_400))
def test_scaled_clock_dates_fit_message_fields(factor: float, since_2026_s: int) -> None:
    wall = DatedClock()
    wall.date_ns = (1_767_225_600 + since_2026_s) * NS_PER_S
    first, other = ScaledClock(wall, factor), ScaledClock(wall, factor)
    wall.time_ns += NS_PER_S
    assert first.utc_ns() == other.utc_ns()
    assert 0 <= first.utc_ns() // NS_PER_S < 2**31


def test_wall_clock_sleeps_until_a_future_time_only_and_ignores_jumps_of_the_date(monkeypatch):
    hours = count(start=1_800_000_000, step=3600)
    monkeypatch.setattr(time, "time_ns", lambda: next(hours) * NS_PER_S)
    monkeypatch.setattr(time, "time", lambda: float(next(hours)))
    clock = WallClock()
    before_ns = clock.now_ns()
    clock.sleep_until(before_ns - NS_PER_S)
    clock.sleep_until(before_ns + 1_000_000)
    assert 1_000_000 <= clock.now_ns() - before_ns < 60 * NS_PER_S
    assert clock.utc_ns() - clock.utc_ns() == -3600 * NS_PER_S  # the date itself has jumped


@pytest.mark.parametrize("extra", ALL, ids=lambda extra: extra.requirement)
def test_extras_exist_in_their_distribution(extra: Extra):
    distribution, _, name = extra.requirement.removesuffix("]").partition("[")
    assert name in (metadata(distribution).get_all("Provides-Extra") or [])


def test_extra_that_is_missing_says_how_to_get_it(tmp_path, monkeypatch):
    Extra("a[b]", ("json",)).need("films")
    with pytest.raises(BadInput, match=r"^films: needs no_module_a and no_module_b: install swarmwire\[b\]$"):
        Extra("swarmwire[b]", ("json", "no_module_a", "no_module_b")).need("films")
    (tmp_path / "uv-receipt.toml").touch()
    monkeypatch.setattr("sys.prefix", str(tmp_path))
    assert Extra("swarmwire-agent[b]", ()).remedy() == "make install EXTRAS=b"
    assert Extra("a[b]", ()).remedy() == "install a[b]"  # of others, which the clone does not have
