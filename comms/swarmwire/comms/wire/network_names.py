"""Names in the robots' network: parts of keys, common names of certificates, and names of files."""

import re

LONGEST = 63  # of a part of a host's name, as which a certificate has it; a common name may have 64
WANTED = f"expected 1 to {LONGEST} letters (a to z), digits, - and _ that start with a letter and do not end in -"
_NAME = re.compile(rf"[A-Za-z](?:[A-Za-z0-9_-]{{0,{LONGEST - 2}}}[A-Za-z0-9_])?")


def fault_of_name(name: str) -> str | None:
    """What was expected instead of this name; None if it is one.

    >>> fault_of_name("flock-3") is None
    True
    >>> fault_of_name("radio/*")
    "expected 1 to 63 letters (a to z), digits, - and _ that start with a letter and do not end in -, got 'radio/*'"
    """
    return None if _NAME.fullmatch(name) else f"{WANTED}, got {name!r}"
