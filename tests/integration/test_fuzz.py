"""Each door, fuzzed for a moment: whatever comes is taken or refused by name. `python -m tests.tools.fuzz` goes further."""

from pathlib import Path

import pytest

from tests.tools.fuzz.fuzzing import fuzz
from tests.tools.fuzz.target import ACCEPTED, Target
from tests.tools.fuzz.targets.registry import ALL
from tests.tools.fuzz.trial import tried

SEED = 1


@pytest.mark.parametrize("kind", ALL, ids=lambda kind: kind.name)
def test_whatever_comes_in_is_taken_or_refused_by_name(kind: type[Target], tmp_path: Path) -> None:
    target = kind(tmp_path)
    became = [tried(target, sample) for sample in target.samples]
    assert not [found for _, found in became if found]
    assert ACCEPTED in [word for word, _ in became], "what nobody changed is taken"
    report = fuzz(target, SEED, range(kind.quick), kind.quick)
    assert not report.findings, "\n".join(map(str, report.findings))
    assert report.cases == kind.quick
    assert report.accepted < report.cases, "some are refused"
