"""What users rely on is only removed or changed on purpose: agents' API, scenario keys, summary, frames, tables."""

from pathlib import Path

import pytest

from tests.tools.stable import kept

DECIDE = (
    "no longer there. If that is wanted, raise the version (docs/stability.md says where it stands), tell users in "
    "CHANGELOG.md, and write the list again: `python -m tests.tools.stable.kept`."
)


@pytest.mark.parametrize("name", kept.STABLE)
def test_nothing_that_users_rely_on_is_removed(name: str):
    assert kept.removed(name) == [], DECIDE


def test_an_addition_passes_and_a_removal_or_a_change_does_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "keys.txt").write_text("# one\na: number\n# two\na: number\nb: text\n")
    monkeypatch.setattr(kept, "place_of", lambda name: tmp_path / f"{name}.txt")
    for now, removed in (
        ("# one\na: number\nz: new\n# two\nb: text\na: number\n# three\n", []),
        ("# one\na: number\n# two\nb: text\n", ["# two: a: number"]),
        ("# one\na: number\n# two\na: number\nb: number\n", ["# two: b: text"]),
    ):
        monkeypatch.setitem(kept.STABLE, "keys", lambda text=now: text)
        assert kept.removed("keys") == removed
