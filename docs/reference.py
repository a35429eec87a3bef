"""Writes the generated tables into the pages: `python -m docs.reference`. `make docs-check` finds those out of date.

A table stands between two comments, `<!-- reference: NAME -->` or `<!-- reference: NAME PART -->` and
`<!-- /reference -->`. NAME is one of `reference_tables.TABLES`, PART the path of a scenario's table or the class of a
behaviour. A table at `<!-- built: NAME -->` is only in the built site.
"""

import re
import sys
from pathlib import Path

from docs.reference_tables import TABLES
from swarmwire.comms.base.errors import BadInput
from tests.docs.pages import PAGES

ROOT = Path(__file__).parents[1]
MARKED = re.compile(r"(^<!-- reference: ([^\n]+) -->\n)(.*?)(^<!-- /reference -->$)", re.DOTALL | re.MULTILINE)
BUILT = re.compile(r"^<!-- built: ([^\n]+) -->$", re.MULTILINE)


def built(text: str, page: str) -> str:
    """Return the text with the tables that only the site has; BadInput for a table that does not exist."""
    return BUILT.sub(lambda match: _table(match[1], page, match[0]), text)


def filled(text: str, page: str) -> str:
    """The text of a page with its tables as they are now; BadInput for a table that does not exist."""

    def table(match: re.Match[str]) -> str:
        return f"{match[1]}\n{_table(match[2], page, match[1].strip())}\n\n{match[4]}"

    return MARKED.sub(table, text)


def _table(call: str, page: str, comment: str) -> str:
    """Table of a call such as "keys radio"."""
    name, *part = call.split()
    if name not in TABLES:
        raise BadInput(page, comment, f"expected one of {', '.join(TABLES)}")
    return TABLES[name](*part).strip()


def main() -> int:
    """Write the pages whose tables changed, and print their names."""
    for page in PAGES:
        before = (ROOT / page).read_text(encoding="utf-8")
        after = filled(before, page)
        if after != before:
            (ROOT / page).write_text(after, encoding="utf-8")
            sys.stdout.write(f"written: {page}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
