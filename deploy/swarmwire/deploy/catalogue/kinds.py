"""The kinds of things that have a name. A new kind is one entry here."""

from collections.abc import Callable
from dataclasses import dataclass

from swarmwire.deploy.catalogue.behaviours import behaviours
from swarmwire.deploy.catalogue.bodies import bodies
from swarmwire.deploy.catalogue.drives import drives
from swarmwire.deploy.catalogue.engines import engines
from swarmwire.deploy.catalogue.entry import Entry
from swarmwire.deploy.catalogue.events import events
from swarmwire.deploy.catalogue.fates import fates
from swarmwire.deploy.catalogue.metrics import metrics
from swarmwire.deploy.catalogue.presets import presets
from swarmwire.deploy.catalogue.radio_stages import radio_stages
from swarmwire.deploy.catalogue.robot_protocols import drivers, gateways
from swarmwire.deploy.catalogue.scenario_keys import keys, radio_keys
from swarmwire.deploy.catalogue.sensors import sensors
from swarmwire.deploy.catalogue.sheet_keys import sheet_keys


@dataclass(frozen=True)
class Kind:
    """One kind."""

    name: str  # as in `swarmwire list NAME`
    one: str  # as in `swarmwire describe ONE:name`, and the `kind` of its entries
    help: str  # one line
    entries: Callable[[], list[Entry]]


KINDS = (
    Kind("bodies", "body", "kinds of robot: size, drive and sensors", bodies),
    Kind("drives", "drive", "what may move a body, with the keys of its table", drives),
    Kind("body-keys", "body-key", "keys of a body's file; its drive and sensors are kinds of their own", sheet_keys),
    Kind("sensors", "sensor", "what an agent may read of its robot and of packets, if its needs name it", sensors),
    Kind("behaviours", "behaviour", "agents that come with swarmwire, with their parameters", behaviours),
    Kind("events", "event", "what may happen to robots and radios on the way", events),
    Kind("metrics", "metric", "what can be measured of a run; the standard ones are in every run", metrics),
    Kind("radio", "radio", "keys of a scenario's radio", radio_keys),
    Kind("presets", "preset", "kinds of radio that a scenario may name", presets),
    Kind("stages", "stage", "what a packet passes on its way to a receiver, in order", radio_stages),
    Kind("fates", "fate", "what may become of a packet for one receiver", fates),
    Kind("engines", "engine", "what moves the bodies of a run", engines),
    Kind("drivers", "driver", "real robots that swarmwire-agent can drive", drivers),
    Kind("gateways", "gateway", "real robots that robots of a run can answer as", gateways),
    Kind("keys", "key", "all other keys of a scenario", keys),
)
