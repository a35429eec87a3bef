"""Agents at the door: they must import, take their parameters, and find what they need on body and radio."""

from collections.abc import Mapping
from pathlib import Path

from swarmwire.agent.agent import AgentClass, NoAgent, load_agent
from swarmwire.agent.parameters import BadParameter, checked
from swarmwire.comms.errors import BadInput
from swarmwire.comms.plugins import resolve
from swarmwire.world.scenario.bodies import bodies_of
from swarmwire.world.scenario.scenario import Scenario


def agent_specs(scenario: Scenario) -> dict[str, str]:
    """By group: the agent's spec, with the path of a file beside the scenario made absolute."""
    beside = Path(scenario.source).parent
    return {name: resolve(group.agent, beside) for name, group in scenario.robots.items()}


def check_agents(scenario: Scenario, specs: Mapping[str, str]) -> dict[str, AgentClass]:
    """By group: the agent's class, fit for its robots; BadInput names the first that is not."""
    return {name: _checked(scenario, name, spec) for name, spec in specs.items()}


def _checked(scenario: Scenario, name: str, spec: str) -> AgentClass:
    group, where = scenario.robots[name], scenario.source
    try:
        kind = load_agent(spec)
        checked(kind, group.params, group.count)
    except NoAgent as error:
        raise BadInput(where, f"robots.{name}.agent", str(error)) from error
    except BadParameter as error:
        raise BadInput(where, f"robots.{name}.params.{error.key}", error.expected) from error
    body = bodies_of(scenario, where)[name]
    of_radio = scenario.radio.tells if scenario.radio else ()
    for need in kind.needs:
        if need.startswith("radio."):
            if need not in of_radio:
                text = f"{kind.__name__} needs {need!r}, which {_untold(need, scenario)}"
                raise BadInput(where, f"robots.{name}.agent", text)
        elif need not in body.sensors:
            text = f"{kind.__name__} needs {need!r}, which the body {body.name} lacks: it has {', '.join(body.sensors)}"
            raise BadInput(where, f"robots.{name}.agent", text)
    return kind


def _untold(need: str, scenario: Scenario) -> str:
    if need == "radio.tx_status":
        return "only a radio that acknowledges tells: expected radio.access.method csma-802154 or dcf, acknowledged"
    if scenario.radio is None:
        return "only a radio tells: there is no [radio]"
    return f"the radio does not measure: [radio.measures] has {', '.join(scenario.radio.measures.needs) or 'nothing'}"
