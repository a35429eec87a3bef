"""TOML files of users, read or refused in one line."""

import tomllib
from pathlib import Path
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.parsing import from_toml


def read_toml(path: Path, named_by: tuple[str, str] | None = None) -> dict[str, Any]:
    """The content of a file; BadInput if it cannot be read.

    A file that another one names, `named_by` as (file, key), is refused there if it is missing.
    """
    try:
        return from_toml(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        if named_by is not None:
            raise BadInput(*named_by, f"expected a readable file: {path}: {error.strerror}") from None
        raise BadInput(str(path), "", f"expected a readable file: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(str(path), "", f"expected TOML: {error}") from None
