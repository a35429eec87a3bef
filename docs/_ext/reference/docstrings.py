"""What the docstrings of a class and of its bases tell, as one text."""

from inspect import cleandoc
from typing import Any


def told_of(kind: type[Any], below: type[Any]) -> str:
    """The docstrings of the bases that lie below the class `below`, from the most general on, and of `kind` last."""
    ours = [base for base in kind.__mro__ if issubclass(base, below) and base is not below]
    return "\n\n".join(cleandoc(base.__doc__) for base in reversed(ours) if base.__doc__)
