"""Escaping of texts from files and other machines before they are printed or logged.

Terminals interpret control characters: an escape sequence in a name can erase or forge lines, and a bidi control shows
letters in another order.
"""

LINES = "\n\t"  # characters to keep in multi-line texts such as tracebacks


def printable(text: str, max_letters: int | None = None, keep: str = "") -> str:
    r"""Return the text with unprintable characters, except those in `keep`, escaped as Python writes them in a literal.

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
