"""The places that the pages for maintainers name are there."""

import re
import subprocess

import pytest

from tests.docs.pages import ROOT

PLACE = re.compile(r"`([\w…/.-]+(?:/|\.py|\.toml))`")


def files() -> list[str]:
    """Every file of the project, by its path from the root, and every folder with a slash at its end."""
    told = subprocess.run(
        ["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    found = [line for line in told.stdout.splitlines() if (ROOT / line).exists()]
    return found + sorted({f"{parent}/" for line in found for parent in (ROOT / line).relative_to(ROOT).parents})


@pytest.mark.parametrize("page", ["docs/design.md", "CONTRIBUTING.md"])
def test_every_place_that_a_page_names_is_there(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    names = [name.replace("/…/", "/**/") for name in PLACE.findall(text)]
    assert names
    there = [*files(), "runs/"]  # which runs make
    missing = [name for name in names if not any(fits(path, name) for path in there)]
    assert missing == []


def fits(path: str, name: str) -> bool:
    """Whether a path ends as a name says, whatever stands for its dots."""
    pattern = re.escape(name).replace(r"/\*\*/", "/(?:.*/)?")
    return re.search(f"(?:^|/){pattern}$", path) is not None
