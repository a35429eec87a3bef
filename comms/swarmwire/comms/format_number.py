"""The version that a file names as its `format`: any other one, or none, is refused in one line."""

from collections.abc import Mapping
from typing import cast

from swarmwire.comms.errors import BadInput

KEY = "format"


def check_format(content: object, known: int, where: str) -> None:
    """Return if the table in a file names the known format; BadInput if it names another one, or none.

    Called before anything else of the file is read, since other formats may have other keys. Content that is no table
    is left to the reader of the rest.

    >>> check_format({"format": 1}, 1, "a.toml")
    >>> check_format({"format": 2}, 1, "a.toml")
    Traceback (most recent call last):
    swarmwire.comms.errors.BadInput: a.toml: format: expected 1, got 2: made by a newer swarmwire; upgrade to read it
    >>> check_format({}, 1, "a.toml")
    Traceback (most recent call last):
    swarmwire.comms.errors.BadInput: a.toml: format: is missing: expected 1
    """
    if not isinstance(content, Mapping):
        return
    table = cast("Mapping[str, object]", content)
    if KEY not in table:
        raise BadInput(where, KEY, f"is missing: expected {known}")
    found = table[KEY]
    if type(found) is int and found == known:
        return
    if type(found) is int and found > known:
        whose = ": made by a newer swarmwire; upgrade to read it"
    elif type(found) is int and found > 0:
        whose = ": made by an older swarmwire; that one reads it"
    else:
        whose = ""
    raise BadInput(where, KEY, f"expected {known}, got {found!r}{whose}")
