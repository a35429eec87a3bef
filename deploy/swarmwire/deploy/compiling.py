"""Compiling: kernels are compiled where they are first used on a machine, and people are told why nothing moves."""

from collections.abc import Generator
from contextlib import contextmanager

from rich.console import Console

COMPILE = "numba:compile"  # numba's event, which it does not raise for kernels that it finds compiled
TOLD = "compiling kernels that this machine does not have yet: for a minute or so, then they are kept"


@contextmanager
def compiling_told(console: Console) -> Generator[None]:
    """Say so, once, if something is compiled meanwhile."""
    from numba.core import event

    class Teller(event.Listener):
        has_told = False

        def on_start(self, event: event.Event) -> None:
            if not self.has_told:
                self.has_told = True
                console.print(TOLD, soft_wrap=True)

        def on_end(self, event: event.Event) -> None:
            """What comes next shows that it is over."""

    teller = Teller()
    event.register(COMPILE, teller)
    try:
        yield
    finally:
        event.unregister(COMPILE, teller)
