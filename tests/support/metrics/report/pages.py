"""Pages taken apart, for tests."""

from dataclasses import dataclass, field
from html.parser import HTMLParser

# Which have no end tag in HTML, and what SVG closes itself.
VOID = {"meta", "br", "wbr", "img", "link", "input", "hr"}
FETCHING = ("src", "href", "xlink:href", "srcset", "data", "poster", "action")


@dataclass
class Page(HTMLParser):
    """What a page holds; elements that are not closed, or closed twice, fail."""

    text: str
    tags: list[str] = field(default_factory=list)
    ids: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
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
        if data.strip() and "svg" not in self._open:
            self.said.append(data.strip())
        if {"td", "th"} & set(self._open):
            self.tables[-1][-1][-1] += data

    def _see(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in FETCHING:
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
    assert page.text.count("url(") == page.text.count("url(#")
    within = [target for target in page.fetched if not target.startswith("data:image/png;base64,")]
    assert all(target.startswith("#") for target in within)
    assert {target[1:] for target in within} <= set(page.ids)
    assert len(set(page.ids)) == len(page.ids)
