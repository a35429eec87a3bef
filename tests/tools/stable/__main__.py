"""Writes the lists of what is public and what is stable anew: `python -m tests.tools.stable`."""

from tests.tools.stable.kept import KEPT, place_of

for name, text in KEPT.items():
    place_of(name).write_text(text(), encoding="utf-8")
    print(f"written: {place_of(name)}")
