"""Drives: what may move a body, by the `kind` in the table [drive] of its sheet."""

from swarmwire.comms.bodies.drives import DRIVES
from swarmwire.deploy.catalogue.docs import first_line, paragraphs
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass


def drives() -> list[Entry]:
    """All kinds of drive, with the keys of their tables."""
    return [
        Entry(
            kind="drive",
            name=name,
            help=first_line(kind.__doc__),
            facts=(("in a body's sheet", f'kind = "{name}" in [drive]'),),
            tables=(ParameterTable("keys", parameters_of_dataclass(kind)),),
            text=paragraphs(kind.__doc__),
        )
        for name, kind in DRIVES.items()
    ]
