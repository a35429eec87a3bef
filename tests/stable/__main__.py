"""Writes the lists of what is public and what is stable anew: `python -m tests.stable`."""

from tests.stable.kept import KEPT, place_of

for name, text in KEPT.items():
    place_of(name).write_text(text(), encoding="utf-8")
    print(f"written: {place_of(name)}")
