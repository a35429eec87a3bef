"""What stands in for numba where coverage looks: kernels compute the same as compiled, and long ones are left."""

import json
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from _pytest.outcomes import Skipped

from tests.tools.coverage.counted import Counted, counted


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The plugin, as if it had been loaded; numba's own `njit` is there again afterwards."""
    monkeypatch.setattr(numba, "njit", numba.njit)
    from tests.tools.coverage import plain_kernels

    monkeypatch.setattr(plain_kernels._Calls, "in_this_test", 0)
    return plain_kernels


class Held(NamedTuple):
    link: np.ndarray
    seen: np.ndarray


RECORD = np.dtype([("power_mw", "f8"), ("fate", "u1")])


def test_fields_of_records_are_attributes_also_in_tuples_and_kernels_within(plain: Any) -> None:
    @plain.njit(cache=True)
    def inner(held, at):
        held.link[at].power_mw = 2.5
        held.seen[0] += 1

    @plain.njit
    def outer(held):
        inner(held, 1)
        return held.link[1].power_mw

    held = Held(np.zeros(3, RECORD), np.zeros(1, np.int64))
    assert outer(held) == 2.5
    assert held.link["power_mw"].tolist() == [0.0, 2.5, 0.0]
    assert held.seen.tolist() == [1]


def test_numbers_that_run_over_wrap_and_divisions_by_zero_are_infinite_without_a_warning(plain: Any) -> None:
    @plain.njit(cache=True)
    def kernel(x, y):
        return x * x, np.float64(1.0) / y

    assert kernel(np.uint64(2**63 + 1), np.float64(0.0)) == (1, np.inf)


def test_a_test_with_more_calls_than_allowed_is_left_with_its_reason(plain: Any, monkeypatch) -> None:
    monkeypatch.setattr(plain, "MOST_CALLS", 3)

    @plain.njit
    def kernel():
        return 1

    assert [kernel() for _ in range(3)] == [1, 1, 1]
    with pytest.raises(Skipped, match="needs the compiler: it calls kernels more than 3 times"):
        kernel()
    plain.pytest_runtest_setup()
    assert kernel() == 1


def test_shares_are_counted_by_part(tmp_path: Path) -> None:
    def told(lines: int, branches: int) -> dict[str, object]:
        summary = {"covered_lines": lines, "num_statements": 10, "covered_branches": branches, "num_branches": 4}
        return {"summary": {**summary, "percent_covered": 1.0}}

    files = {f"{part}/swarmwire/{part}/a.py": told(8, 2) for part in ("comms", "world", "agent")}
    files["comms/swarmwire/comms/air/b.py"] = told(10, 4)
    (tmp_path / "all.json").write_text(json.dumps({"files": files}))
    found = counted(tmp_path / "all.json")
    assert found["comms"] == Counted(0.9, 0.75)
    assert found["world"] == found["agent"] == Counted(0.8, 0.5)
    assert found["together"] == Counted(34 / 40, 10 / 16)
