"""Lines of a trace's text file, plain or compressed by gzip, with the errors about them."""

import gzip
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO, cast

from swarmwire.comms.base.errors import BadInput

MAX_NUMBER = 1e15  # magnitude up to which differences of positions and times stay finite and useful


@dataclass(frozen=True)
class Line:
    """A line that is not blank."""

    path: Path
    number: int  # from 1
    text: str  # without spaces at its ends

    @property
    def content(self) -> str:
        """The text without a comment, which begins with #."""
        return self.text.partition("#")[0].rstrip()

    def refused(self, expected: str) -> BadInput:
        """Return a BadInput about this line."""
        return BadInput(str(self.path), f"line {self.number}", expected)

    def parse_numbers(self, words: Iterable[str]) -> list[float]:
        """Return words of the line as numbers; BadInput for a word that is none, NaN or infinite."""
        return [self._parse_number(word) for word in words]

    def _parse_number(self, word: str) -> float:
        try:
            number = float(word)
        except ValueError:
            raise self.refused(f"expected a number, got {word!r}") from None
        if not abs(number) <= MAX_NUMBER:
            raise self.refused(f"expected a number of at most {MAX_NUMBER:g}, got {word!r}")
        return number


def read_lines(path: Path) -> Iterator[Line]:
    """Yield the lines that are not blank; BadInput if the file cannot be read."""
    try:
        with open_text(path, "r") as file:
            for number, text in enumerate(file, 1):
                if stripped := text.strip():
                    yield Line(path, number, stripped)
    except UnicodeDecodeError:
        raise BadInput(str(path), "", "expected a text file in UTF-8") from None
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or error
        raise BadInput(str(path), "", f"expected a readable file: {reason}") from None


def open_text(path: Path, mode: str) -> TextIO:
    """Open a text file for reading ("r") or writing ("w")."""
    encoding = "utf-8-sig" if mode == "r" else "utf-8"
    if path.suffix.lower() == ".gz":
        return cast("TextIO", gzip.open(path, f"{mode}t", encoding=encoding))
    return cast("TextIO", path.open(mode, encoding=encoding))


def refuse_empty(path: Path) -> BadInput:
    """Return a BadInput about a file without any motion."""
    return BadInput(str(path), "", "expected the motion of at least one robot")
