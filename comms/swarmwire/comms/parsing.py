"""JSON and TOML of users and of disks that lie: whatever is wrong with a text is a ValueError."""

import json
import tomllib
from typing import Any

TOO_DEEP = "lists or tables within one another, too many to be meant"


def from_json(text: str | bytes) -> Any:
    """What the text says; ValueError if it is no JSON, also where Python's own reader gives up."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError(TOO_DEEP) from None


def from_toml(text: str) -> dict[str, Any]:
    """The table that the text says; `tomllib.TOMLDecodeError` if it is no TOML, also where Python's reader gives up."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise tomllib.TOMLDecodeError(TOO_DEEP) from None
    except ValueError as error:  # a number of thousands of digits, a date that there is not
        raise tomllib.TOMLDecodeError(str(error)) from None
