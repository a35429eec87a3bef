"""The options of `swarmwire run` about robots that answer as real ones, parsed."""

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from swarmwire.comms.base.config import from_toml
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.access_control import TRACKER
from swarmwire.comms.wire.network import Network, as_options
from swarmwire.deploy.robots.certificates.member import member
from swarmwire.deploy.runs.gateways.gateways import LOOPBACK, Gateways


def parse_gateways(
    gateways: Sequence[str], options: Sequence[str], swarm: str | None, network: Network | None
) -> Gateways | None:
    """Parse `--gateway [GROUP=]KIND[@ADDRESS]` and its companion options; None without a gateway.

    BadInput for an invalid form, and for companion options without a gateway.
    """
    kinds: dict[str, str] = {}
    for text in gateways:
        before, at_sign, address = text.partition("@")
        group, equals, kind = before.rpartition("=")
        if not kind or (equals and not group) or (at_sign and not address):
            raise BadInput("--gateway", text, "expected KIND, KIND@ADDRESS, GROUP=KIND or GROUP=KIND@ADDRESS")
        if group in kinds:
            robots = f"the group {group!r}" if group else "all groups"
            raise BadInput("--gateway", text, f"expected one gateway for {robots}, got a second one")
        kinds[group] = f"{kind}{at_sign}{address}"
    if kinds:
        parsed = Gateways(kinds, dict(_parse_option(text) for text in options))
        parsed = parsed if swarm is None else replace(parsed, swarm=swarm)
        return parsed if network is None else replace(parsed, network=network)
    network_flag = "--network"
    if network is not None and (network.proves or network.insecure):
        network_flag = "--certs" if network.proves else "--insecure"
    for flag, value in (("--gateway-set", bool(options)), ("--swarm", swarm), (network_flag, network)):
        if value:
            raise BadInput(flag, "", "expected --gateway with it: no robot of this run answers as a real one")
    return None


def gateway_network(
    endpoint: str | None, certs: Path | None, revoked: Sequence[str] = (), *, insecure: bool
) -> Network | None:
    """Return the network of `--network` and its companion options; None without these. BadInput if it is not safe.

    The run is the tracker of its robots' network, and has its name.
    """
    name = None if certs is None else TRACKER
    credentials = member(TRACKER, certs=certs, name=name, revoked=revoked, insecure=insecure).network
    if endpoint is None and credentials == Network():
        return None
    network = replace(credentials, listen=LOOPBACK.listen if endpoint is None else (endpoint,))
    try:
        network.check("")
    except BadInput as error:
        raise BadInput("--network", "", as_options(error.expected)) from None
    return network


def _parse_option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise BadInput("--gateway-set", text, "expected OPTION=VALUE or GROUP.OPTION=VALUE")
    try:
        table = from_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return name.strip(), value.strip()
    return name.strip(), table["value"] if len(table) == 1 else value
