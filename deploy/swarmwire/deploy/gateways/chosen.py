"""From what users say of gateways to one for each group that has one, checked at the door."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from swarmwire.comms.bodies.body import Body
from swarmwire.comms.bodies.tables import built
from swarmwire.comms.config import did_you_mean
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import fault_of_name
from swarmwire.deploy.gateways.gateways import OTHERS, Gateways
from swarmwire.world.gateways.gateway import Gateway, gateway_kind
from swarmwire.world.scenario.scenario import Scenario

WHERE, OPTION, SWARM = "--gateway", "--gateway-set", "--swarm"


@dataclass(frozen=True)
class Chosen:
    """The gateway of one group, not made yet."""

    kind: str
    address: str  # "": of the gateway's choice
    made: type[Gateway]
    options: Any  # an instance of `made.options`

    def sensors(self, body: Body) -> tuple[str, ...]:
        """The sensors of this body that it tells."""
        return tuple(name for name in body.sensors if name in self.made.sensors)


def chosen_gateways(gateways: Gateways, scenario: Scenario) -> dict[str, Chosen]:
    """By group: its gateway; BadInput for a group, kind or option that is not there, or a value that will not do."""
    for group in gateways.of:
        if group != OTHERS and group not in scenario.robots:
            expected = f"expected a group of the scenario, {did_you_mean(scenario.robots, group)}; got {group!r}"
            raise BadInput(WHERE, f"{group}={gateways.of[group]}", expected)
    fault = fault_of_name(gateways.swarm)
    if fault:
        raise BadInput(SWARM, "", fault)
    texts = {group: gateways.of.get(group, gateways.of.get(OTHERS)) for group in scenario.robots}
    kinds = {group: text.partition("@") for group, text in texts.items() if text is not None}
    made = {group: gateway_kind(kind, WHERE, texts[group] or "") for group, (kind, _, _) in kinds.items()}
    options = _options(gateways.options, made)
    return {
        group: Chosen(kind, address, made[group], built(made[group].options, options[group], OPTION, ""))
        for group, (kind, _, address) in kinds.items()
    }


def _options(given: Mapping[str, Any], made: Mapping[str, type[Gateway]]) -> dict[str, dict[str, Any]]:
    """By group what was given for its gateway; what names a group counts more than what is for all."""
    known = {group: {of.name for of in fields(kind.options)} for group, kind in made.items()}
    found: dict[str, dict[str, Any]] = {group: {} for group in made}
    for name in sorted(given, key=lambda name: "." in name):
        group, _, option = name.rpartition(".")
        if group and group not in made:
            expected = f"expected a group that has a gateway, {did_you_mean(made, group)}; got {group!r}"
            raise BadInput(OPTION, name, expected)
        takers = [of for of in ([group] if group else made) if option in known[of]]
        if not takers:
            options = sorted(set[str]().union(*(known[of] for of in ([group] if group else made))))
            expected = (
                f"unknown option; expected {did_you_mean(options, option)}"
                if options
                else "expected none: it has no options"
            )
            raise BadInput(OPTION, name, expected)
        for of in takers:
            found[of][option] = given[name]
    return found
