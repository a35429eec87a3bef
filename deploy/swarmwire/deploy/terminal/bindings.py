"""Which key asks for what."""

from collections.abc import Callable
from typing import NamedTuple

from swarmwire.deploy.controls import Controls


class Binding(NamedTuple):
    """One thing to ask for."""

    keys: str  # each of these characters
    shown: str  # how people call the first of them
    name: str  # one word
    help: str
    ask: Callable[[Controls], None]


BINDINGS = (
    Binding(" ", "space", "pause", "pause, or go on", Controls.toggle_pause),
    Binding("s.", "s", "step", "one tick, then pause again", Controls.step),
    Binding("+=", "+", "faster", "faster, at last without a limit", Controls.faster),
    Binding("-_", "-", "slower", "slower: limit the speed", Controls.slower),
    Binding("qQ", "q", "quit", "end after this tick", Controls.quit),
    Binding("?h", "?", "help", "show this, or no longer", Controls.toggle_help),
)


def press(controls: Controls, key: str) -> None:
    """Do what a key asks for; any other key does nothing."""
    for binding in BINDINGS:
        if key in binding.keys:
            binding.ask(controls)
