"""Writes what each fault does into docs/reliability.md: `python -m tests.tools.reliability`."""

from tests.tools.reliability.page import PAGE, written

PAGE.write_text(written(), encoding="utf-8")
print(f"written: {PAGE}")
