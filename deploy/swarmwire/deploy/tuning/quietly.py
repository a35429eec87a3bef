"""Optuna without its words about studies that were made: what people read here are ours."""

from collections.abc import Generator
from contextlib import contextmanager

import optuna


@contextmanager
def quietly() -> Generator[None]:
    """While the block lasts, Optuna logs warnings and errors alone."""
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        yield
    finally:
        optuna.logging.set_verbosity(before)
