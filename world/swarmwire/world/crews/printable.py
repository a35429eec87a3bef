"""Texts from elsewhere, fit for a terminal and a log."""


def printable(text: str, most: int, keep: str = "") -> str:
    r"""The text without what a terminal would obey, but for letters in `keep`, cut to `most` letters.

    >>> printable("flock-0\x1b[2J", 40)
    'flock-0\\x1b[2J'
    >>> printable("flock-0", 4)
    'flo…'
    """
    cut = text if len(text) <= most else text[: most - 1] + "…"
    return "".join(
        letter if letter.isprintable() or letter in keep else letter.encode("unicode_escape").decode() for letter in cut
    )
