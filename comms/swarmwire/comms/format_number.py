"""The version that a file names as its `format`: another one is refused in a line that says what to do."""

from swarmwire.comms.errors import BadInput

KEY = "format"


def check_format(found: object, known: int, where: str, key: str = KEY) -> None:
    """Return if a file names the format that is known here; else BadInput, of a newer, an older or no version at all.

    >>> check_format(1, 1, "a.toml")
    >>> check_format(2, 1, "a.toml")
    Traceback (most recent call last):
    swarmwire.comms.errors.BadInput: a.toml: format: expected 1, got 2: made by a newer swarmwire; upgrade to read it
    """
    if type(found) is int and found == known:
        return
    if type(found) is int and found > known:
        whose = ": made by a newer swarmwire; upgrade to read it"
    elif type(found) is int and found > 0:
        whose = ": made by an older swarmwire; that one reads it"
    else:
        whose = ""
    raise BadInput(where, key, f"expected {known}, got {found!r}{whose}")
