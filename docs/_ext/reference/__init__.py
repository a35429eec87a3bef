"""A Sphinx extension: the reference's tables, made from the registries each time the site is built.

A page asks for one by name, ```` ```{reference} fates ````, for keys of a scenario with the path of their table,
```` ```{reference} keys radio ````, and for a behaviour with its name. `TABLES` lists them. Each is a function that
returns Markdown, so that a page reads as if the table stood in it.
"""

from collections.abc import Callable

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.util.typing import ExtensionMetadata

from reference import array_names, docstrings, field_comments
from reference.actuators import drive_tables, led_table
from reference.behaviours import behaviour_details, behaviour_table
from reference.bodies import body_keys, body_sources, body_table
from reference.commands import command_tables
from reference.events import event_tables
from reference.fates import fate_table
from reference.fields import field_table
from reference.keys import key_tables
from reference.metrics import metric_details, metric_table
from reference.presets import preset_sources, preset_table
from reference.sensors import reading_table, sensor_tables

TABLES: dict[str, Callable[..., str]] = {
    "behaviour": behaviour_details,
    "behaviours": behaviour_table,
    "bodies": body_table,
    "body-keys": body_keys,
    "body-sources": body_sources,
    "commands": command_tables,
    "drives": drive_tables,
    "events": event_tables,
    "fates": fate_table,
    "fields": field_table,
    "keys": key_tables,
    "leds": led_table,
    "metric-details": metric_details,
    "metrics": metric_table,
    "preset-sources": preset_sources,
    "presets": preset_table,
    "readings": reading_table,
    "sensors": sensor_tables,
}


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
    app.connect("builder-inited", field_comments.teach_autodoc)
    app.connect("autodoc-process-docstring", docstrings.prepare)
    array_names.shorten(app)
    return {"version": "1", "parallel_read_safe": True}
