"""What a report holds, before it is a page: sections of text, listings, tables and figures."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A drawing with what it shows."""

    name: str  # of its file, without .svg: unique within a report
    svg: str  # a whole <svg> element, whose ids are its own
    caption: str


@dataclass(frozen=True)
class Table:
    """A table of texts, numbers already rounded for people."""

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str
    folded: bool = False  # whether the page shows the caption alone until it is asked for the rest


@dataclass(frozen=True)
class Listing:
    """Lines to be read letter by letter: commands, messages of errors."""

    text: str


@dataclass(frozen=True)
class Section:
    """A heading with what belongs under it, in order."""

    title: str
    parts: tuple[str | Listing | Table | Figure, ...]  # a text is a paragraph; `so` within it is code


@dataclass(frozen=True)
class Report:
    """A page."""

    title: str
    sections: tuple[Section, ...]
    about: str = ""  # a line below the title: what it is about, at a glance

    @property
    def figures(self) -> tuple[Figure, ...]:
        """All figures, in order."""
        return tuple(part for section in self.sections for part in section.parts if isinstance(part, Figure))
