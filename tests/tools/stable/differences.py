"""How a list differs from the one that is kept."""

from difflib import unified_diff

import pytest

from tests.tools.stable.kept import KEPT, place_of


def refuse_unless_as_kept(name: str, else_say: str) -> None:
    """Fail, with what differs and what to do about it, unless the list is what its file holds."""
    kept, now = (text.splitlines() for text in (place_of(name).read_text(encoding="utf-8"), KEPT[name]()))
    differ = list(unified_diff(kept, now, f"{name}.txt", "as it is now", lineterm="", n=0))
    if differ:
        pytest.fail("\n".join([*differ[:40], else_say]), pytrace=False)
