"""The names that there are, in words: for errors about one that there is not."""

from collections.abc import Iterable
from difflib import get_close_matches


def one_of(known: Iterable[str], given: object = None) -> str:
    """The words "one of a, b, c", and which of these was probably meant, if what was `given` is near one of them.

    >>> one_of(["range_m", "loss"], "range")
    'one of range_m, loss (did you mean range_m?)'
    """
    names = list(known)
    if not names:
        return "none"
    near = get_close_matches(given, names, n=1) if isinstance(given, str) else []
    return f"one of {', '.join(names)}" + "".join(f" (did you mean {name}?)" for name in near)
