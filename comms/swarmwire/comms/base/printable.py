"""Texts from files and other machines, made harmless before people see them in a terminal or a log.

A terminal obeys control characters: an escape sequence in a name can erase or forge lines, and a bidi control shows
its letters in another order.
"""

LINES = "\n\t"  # what texts of several lines, such as tracebacks, keep


def printable(text: str, max_letters: int | None = None, keep: str = "") -> str:
    r"""The text with unprintable characters, except those in `keep`, escaped as Python writes them in a literal.

    The result has at most `max_letters` characters of the text.

    >>> printable("flock-0\x1b[2J"), printable("a\nb", keep=LINES)
    ('flock-0\\x1b[2J', 'a\nb')
    >>> printable("flock-0", 4)
    'flo…'
    """
    cut = text if max_letters is None or len(text) <= max_letters else text[: max_letters - 1] + "…"
    if cut.isprintable():
        return cut
    return "".join(c if c.isprintable() or c in keep else c.encode("unicode_escape").decode() for c in cut)
