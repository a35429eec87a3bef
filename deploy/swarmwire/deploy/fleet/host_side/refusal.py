"""What the host cannot do, as the answer that says so."""

import errno

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class Refusal(Exception):
    """One request fails: `kind` is for the program at the other end, `text` for people."""

    def __init__(self, kind: str, text: str) -> None:
        self.kind, self.text = kind, text
        super().__init__(text)


class Cut(Exception):
    """The connection ended in the middle of a request."""


def refusal_of(error: OSError) -> Refusal:
    """The refusal that an error of the system comes to."""
    kind = "full" if error.errno in FULL else "system"
    place = f": {error.filename}" if error.filename else ""
    return Refusal(kind, f"{error.strerror or error}{place}")
