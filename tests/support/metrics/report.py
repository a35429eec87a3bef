"""Pages of reports, and the runs of which they report."""

import base64
import json
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from swarmwire.metrics.measures.measure import Metrics
from swarmwire.metrics.measures.network.latency import RadioTally
from swarmwire.metrics.records.run_folder.events import EventLog
from tests.support.metrics.recorded import made_up_summary, record
from tests.support.metrics.truths import watch

# elements without an end tag in HTML
VOID = {"meta", "br", "wbr", "img", "link", "input", "hr"}
FETCHING = ("src", "href", "srcset", "data", "poster", "action")
IMAGE = "data:image/svg+xml;base64,"


@dataclass
class Page(HTMLParser):
    """What a page holds; elements that are not closed, or closed twice, fail."""

    text: str
    tags: list[str] = field(default_factory=list)
    ids: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    images: list[bytes] = field(default_factory=list)
    alternatives: list[str] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)
    tables: list[list[list[str]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self._open: list[str] = []
        self.feed(self.text)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag, attrs):
        self._see(tag, attrs)
        if tag not in VOID:
            self._open.append(tag)
        if tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in {"td", "th"}:
            self.tables[-1][-1].append("")

    def handle_startendtag(self, tag, attrs):
        self._see(tag, attrs)

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if "style" in self._open:
            return
        if data.strip():
            self.texts.append(data.strip())
        if {"td", "th"} & set(self._open):
            self.tables[-1][-1][-1] += data

    def _see(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name == "alt":
                self.alternatives.append(value)
            if name == "src" and value.startswith(IMAGE):
                self.images.append(base64.b64decode(value.removeprefix(IMAGE)))
            elif name in FETCHING:
                self.fetched.append(value)

    def table(self, *columns):
        """The rows of the first table whose first columns are called so."""
        for table in self.tables:
            if tuple(table[0][: len(columns)]) == columns:
                return table[1:]
        raise AssertionError(f"no table begins with {columns}: {[table[0] for table in self.tables]}")


def check_alone(page):
    """Nothing in the page comes from outside of it, and what it refers to is there once."""
    assert "script" not in page.tags
    assert "@import" not in page.text
    assert "url(" not in page.text
    assert all(target.startswith("#") for target in page.fetched)
    assert {target[1:] for target in page.fetched} <= set(page.ids)
    assert not any(b"href" in image.replace(b'href="#', b"").replace(b'href="data:', b"") for image in page.images)
    assert len(set(page.ids)) == len(page.ids)


def run_folder(folder: Path, run, ticks, ended="duration", summary=True, **options) -> Path:
    """Record these ticks; with a summary as a run writes it, as far as reports read it."""
    truths = list(ticks)
    tables = record(folder, run, truths, **options)
    (folder / "run.json").write_text(json.dumps({"format": 1, "ticks": 50, "cpu": "a CPU", "versions": {"numpy": "2"}}))
    (folder / "scenario.toml").write_text(f"format = 1\nname = '{run.name}'\n")
    if summary:
        counts = {"clipped_commands": 3, "nan_commands": 0}
        summary_json = made_up_summary(
            len(truths),
            arenas=run.arenas,
            rate_hz=run.rate_hz,
            **_observed(run, truths),
            ended=ended,
            counts=counts,
            record=tables,
        )
        (folder / "summary.json").write_text(json.dumps(summary_json))
    return folder


def _observed(run, truths):
    parts: dict[str, Any] = {"radio": None}
    for observer in (Metrics(), RadioTally(), EventLog()):
        watch(run, truths, observer)
        parts.update(observer.end(None))
    if run.arenas == 1:
        parts["metrics"] = parts["metrics"][0]
        parts["radio"] = parts["radio"][0] if parts["radio"] else None
    return parts
