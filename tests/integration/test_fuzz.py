"""Every entry point accepts an input or refuses it by a declared error; `python -m tests.tools.fuzz` tries more."""

from pathlib import Path

import pytest

from tests.tools.fuzz.engine import QUICK, fuzz, run_case
from tests.tools.fuzz.target import ACCEPTED, ByteTarget, Target
from tests.tools.fuzz.targets.registry import TARGETS


@pytest.mark.parametrize("kind", TARGETS.values(), ids=TARGETS)
def test_a_case_is_accepted_or_refused_by_a_declared_error(kind: type[Target], tmp_path: Path) -> None:
    target = kind(tmp_path)
    kinds = [run_case(target, sample) for sample in target.samples]
    assert ACCEPTED in kinds, "a sample is accepted"
    report = fuzz(target, QUICK, kind.quick)
    assert not report.findings, "\n".join(report.findings)
    assert report.accepted < report.cases, "some are refused"


class Planted(ByteTarget):
    """An entry point with every fault that one may have, each behind a byte of its own."""

    name = "planted"
    quick = 500
    limit_s = 0.3

    def make_samples(self) -> list[bytes]:
        return [b"a packet", b"another"]

    def feed(self, case: bytes) -> None:
        if b"\xff" in case:
            raise KeyError(case)
        if b"\xc1" in case:
            raise BaseException("a panic of native code")
        while b"\x91" in case:
            try:
                len(case)
            except Exception:  # noqa: BLE001 - who swallows all errors must not swallow the time limit
                continue


def test_a_fault_is_found_shrunk_and_can_be_run_again(tmp_path: Path) -> None:
    target = Planted(tmp_path)
    (finding,) = fuzz(target, QUICK, target.quick).findings
    blob = finding.split("--reproduce ")[1]
    again = fuzz(target, QUICK, 1, blob=blob)
    assert again.cases <= 2
    assert again.findings
    assert "KeyError" in finding or "panic" in finding or "over 0.3 s" in finding


@pytest.mark.parametrize(
    ("case", "found"), [(b"\xff", "xff"), (b"\xc1", "a panic of native code"), (b"\x91", "over 0.3 s")]
)
def test_errors_panics_and_endless_loops_are_findings(tmp_path: Path, case: bytes, found: str) -> None:
    with pytest.raises((AssertionError, KeyError), match=found):
        run_case(Planted(tmp_path), case)
