"""Keys of a body's data sheet: those at its top level, and those of its LEDs."""

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.drives import Leds
from swarmwire.deploy.catalogue.docs import first_line, paragraphs
from swarmwire.deploy.catalogue.entry import Entry, ParameterTable
from swarmwire.deploy.catalogue.schema_parameters import parameters_of_dataclass

TABLES = ("drive", "leds", "sensors", "actuators")  # have entries of their own, or one below


def sheet_keys() -> list[Entry]:
    """The keys of every sheet, then the table of LEDs."""
    keys = [key for key in parameters_of_dataclass(Body) if key.name.partition(".")[0] not in TABLES]
    places = [
        Entry(
            kind="body-key",
            name=key.name,
            help=key.help,
            facts=(("in a body's sheet", f"{key.name}, before the first table"),),
            tables=(ParameterTable("key", (key,)),),
        )
        for key in keys
    ]
    leds = Entry(
        kind="body-key",
        name="leds",
        help=first_line(Leds.__doc__),
        facts=(("in a body's sheet", "the table [leds]"),),
        tables=(ParameterTable("keys of leds", parameters_of_dataclass(Leds)),),
        text=paragraphs(Leds.__doc__),
    )
    return [*places, leds]
