"""Writes the lists of what users rely on anew: `python -m tests.tools.stable`."""

from tests.tools.stable.kept import STABLE, place_of

for name, text in STABLE.items():
    place_of(name).write_text(text(), encoding="utf-8")
    print(f"written: {place_of(name)}")
