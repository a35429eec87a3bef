"""A Sphinx extension: tables that only the site has. Each replaces a comment `<!-- built: NAME -->` of a page."""

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

from docs.reference import built


def setup(app: Sphinx) -> ExtensionMetadata:
    """Insert the tables whenever a page is read."""
    app.connect("source-read", _insert)
    return {"version": "1", "parallel_read_safe": True}


def _insert(_app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = built(source[0], page)
