"""A Sphinx extension: the reference's tables, made each time the site is built from what `list` and `describe` print.

A page names one, ```` ```{reference} fates ````, keys of a scenario with the path of their table,
```` ```{reference} keys radio ````, and a behaviour with its class. `tables.TABLES` lists them. Each is a function that
returns Markdown, so that a page reads as if the table stood in it.
"""

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

from reference import autodoc
from reference.tables import TABLES


class Reference(SphinxDirective):
    """Puts a generated piece of the reference where it stands."""

    required_arguments = 1
    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The nodes of the Markdown that the named table comes to."""
        name, *about = self.arguments
        if name not in TABLES:
            raise self.error(f"expected one of {', '.join(TABLES)}; got {name!r}")
        return self.parse_text_to_nodes(TABLES[name](*about), allow_section_headings=True)


def setup(app: Sphinx) -> ExtensionMetadata:
    """Add the directive `reference`, and let autodoc read docstrings and comments as this project writes them."""
    app.setup_extension("sphinx.ext.autodoc")
    app.add_directive("reference", Reference)
    autodoc.extend(app)
    return {"version": "1", "parallel_read_safe": True}
