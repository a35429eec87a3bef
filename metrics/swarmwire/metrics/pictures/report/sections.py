"""Sections of a report as entries of a registry: `SECTIONS` in `campaign.py` and in `run.py`."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

from swarmwire.metrics.pictures.report.page import Part, Section

Data = TypeVar("Data")


@dataclass(frozen=True)
class ReportSection(Generic[Data]):
    """A section that reports may have. A new one is such an object and an entry in SECTIONS."""

    title: str
    parts: Callable[[Data], Sequence[Part]]  # no parts: the report omits the section
    methods: tuple[str, ...] = ()  # paragraphs on its statistics, for the section Methods


def build_sections(kinds: Iterable[ReportSection[Data]], data: Data) -> tuple[tuple[Section, ...], tuple[str, ...]]:
    """Return the sections that have parts, and their paragraphs on methods."""
    sections: list[Section] = []
    methods: list[str] = []
    for kind in kinds:
        parts = tuple(kind.parts(data))
        if parts:
            sections.append(Section(kind.title, parts))
            methods += kind.methods
    return tuple(sections), tuple(methods)
