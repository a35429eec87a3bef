"""Rich's console for colours and tables; every text is made printable."""

import os
from collections.abc import Iterable
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from swarmwire.comms.base.printable import LINES, printable

UNWRAPPED = 10_000  # columns


class TerminalConsole(Console):
    """A console with printable texts and without markup: only styles set colours and positions."""

    def __init__(self, **options: Any) -> None:
        super().__init__(highlight=False, markup=False, **options)
        if not self.is_terminal and "width" not in options and "COLUMNS" not in os.environ:
            self.width = UNWRAPPED  # rich's default of 80 would break lines that programs read

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Return rich's segments with printable texts."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else printable(text, keep=LINES), style, control)
