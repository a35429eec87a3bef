"""What a report holds, before it is a page: sections of text, tables and figures."""

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


@dataclass(frozen=True)
class Section:
    """A heading with what belongs under it, in order."""

    title: str
    parts: tuple[str | Table | Figure, ...]  # a text is a paragraph


@dataclass(frozen=True)
class Report:
    """A page."""

    title: str
    sections: tuple[Section, ...]
