"""Examples in docstrings give what they show."""

import doctest
import importlib

import pytest

from tests.release.test_workspace import PARTS, ROOT


def modules() -> list[str]:
    """Those of the five parts that show an example."""
    paths = (path for part in PARTS for path in (ROOT / part).rglob("*.py") if ">>> " in path.read_text("utf-8"))
    return sorted(".".join(path.relative_to(ROOT).with_suffix("").parts[1:]) for path in paths)


@pytest.mark.parametrize("module", modules())
def test_examples_in_docstrings_give_what_they_show(module: str) -> None:
    results = doctest.testmod(importlib.import_module(module), raise_on_error=False)
    assert results.attempted
    assert not results.failed
