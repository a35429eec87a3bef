"""One command gives everything the next version, or nothing."""

import shutil
from pathlib import Path

import pytest

from tests.release.built import ROOT
from tests.release.bump import CITED, OWN, PIN, PROJECTS, bump

FILES = (*PROJECTS, "CHANGELOG.md", "CITATION.cff")


@pytest.fixture
def copied(tmp_path: Path) -> Path:
    for name in FILES:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def everything(root: Path) -> dict[str, str]:
    return {name: (root / name).read_text(encoding="utf-8") for name in FILES}


def test_bump_raises_all_versions_and_pins_and_changes_nothing_else(copied: Path) -> None:
    before = everything(copied)
    bump(copied, "7.8.9", "2027-01-02")
    after = everything(copied)
    changelog, was = after.pop("CHANGELOG.md"), before.pop("CHANGELOG.md")
    assert changelog == was.replace("## [Unreleased]\n", "## [Unreleased]\n\n## [7.8.9] - 2027-01-02\n")
    cited, cited_before = after.pop("CITATION.cff"), before.pop("CITATION.cff")
    assert cited == cited_before.replace(f"version: {OWN.findall(before['pyproject.toml'])[0]}\n", "version: 7.8.9\n")
    assert CITED.findall(cited) == ["7.8.9"]
    pins = 0
    for name, text in after.items():
        lines = list(zip(before[name].splitlines(), text.splitlines(), strict=True))
        changed = [line for was, line in lines if was != line]
        assert OWN.findall(text) == ["7.8.9"]
        assert len(changed) == 1 + sum(PIN.search(line) is not None for _, line in lines)
        pins += text.count("==7.8.9")
    assert pins == sum(len(PIN.findall(text)) for text in before.values()) > 15


@pytest.mark.parametrize("version", ["0.0.1", "next", "01.0", "v1.0", ""])
def test_bump_to_a_version_that_is_not_later_is_refused(version: str, copied: Path) -> None:
    before = everything(copied)
    with pytest.raises(SystemExit, match="expected a version after"):
        bump(copied, version, "2027-01-02")
    assert everything(copied) == before


def test_release_without_changes_is_refused(copied: Path) -> None:
    bump(copied, "7.8.9", "2027-01-02")
    with pytest.raises(SystemExit, match="expected something"):
        bump(copied, "7.9.0", "2027-01-03")
