"""Output to people with colours and tables: rich's console, with every text made printable as `echo` makes it."""

import os
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from swarmwire.comms.base.printable import LINES, printable

UNWRAPPED = 10_000  # columns


class TerminalConsole(Console):
    """A console whose texts are printable and are no markup: colours and positions come from styles alone."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, **options)
        if not self.is_terminal and "width" not in options and "COLUMNS" not in os.environ:
            self.width = UNWRAPPED  # else 80: programs read lines as they are

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Rich's segments, each text printable."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text, keep=LINES), style, control)
