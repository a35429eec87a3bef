"""Which robots of a run answer as real ones, as users say it: in Python, or in options of `swarmwire run`."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from swarmwire.comms.config import from_toml
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.deploy.certificates.revoked import revoked_in

OTHERS = ""  # in place of a group: all that are not named
LOOPBACK = Network(listen=("tcp/127.0.0.1:0",))


@dataclass(frozen=True)
class Gateways:
    """Gateways of a run, and the network on which it tells poses and its air serves agents of such robots.

    `of` has "KIND" or "KIND@ADDRESS" for each group, and for all others under ""; without an address the gateway
    chooses one.
    """

    of: Mapping[str, str]
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])  # by "option", of all, or "group.option"
    swarm: str = "swarm"  # the root of the network's keys
    network: Network = LOOPBACK  # where the run listens; in the default on a free port of this machine alone


GatewaysGiven = Gateways | Mapping[str, str] | str | None


def as_gateways(given: GatewaysGiven) -> Gateways | None:
    """What was given in one of the forms that `run` takes: whole, by group, or one text for all groups.

    Revoked are also the names in the register of certificates beside the CA's, if it is there; BadInput if that cannot
    be read.
    """
    if given is None:
        return None
    gateways = given if isinstance(given, Gateways) else Gateways({OTHERS: given} if isinstance(given, str) else given)
    network = gateways.network
    more = [name for name in revoked_in(network.ca.parent) if name not in network.revoked] if network.ca else []
    return replace(gateways, network=replace(network, revoked=(*network.revoked, *more))) if more else gateways


def gateways_of_options(
    gateways: Sequence[str], options: Sequence[str], swarm: str | None, network: Network | None
) -> Gateways | None:
    """From `--gateway [GROUP=]KIND[@ADDRESS]`, `--gateway-set [GROUP.]OPTION=VALUE` and so on; None: there are none.

    BadInput for texts of another form, and for options without a gateway.
    """
    of: dict[str, str] = {}
    for text in gateways:
        before, at, address = text.partition("@")
        group, equals, kind = before.rpartition("=")
        if not kind or (equals and not group) or (at and not address):
            expected = "expected KIND, KIND@ADDRESS, GROUP=KIND or GROUP=KIND@ADDRESS"
            raise BadInput("--gateway", text, expected)
        if group in of:
            named = f"the group {group!r}" if group else "all groups"
            raise BadInput("--gateway", text, f"expected one gateway for {named}, got a second one")
        of[group] = f"{kind}{at}{address}"
    if of:
        made = Gateways(of, dict(_option(text) for text in options))
        made = made if swarm is None else replace(made, swarm=swarm)
        return made if network is None else replace(made, network=network)
    for flag, given in (("--gateway-set", bool(options)), ("--swarm", swarm), ("--network", network)):
        if given:
            raise BadInput(flag, "", "expected --gateway with it: no robot of this run answers as a real one")
    return None


def network_of(
    endpoint: str | None,
    ca: Path | None,
    certificate: Path | None,
    key: Path | None,
    revoked: Sequence[str] = (),
    *,
    insecure: bool,
) -> Network | None:
    """From `--network` and what goes with it; None where nothing is said of it. BadInput if it will not do."""
    if revoked and ca is None:
        raise BadInput("--revoked", "", "expected --ca with it: without certificates nobody is known by name")
    if endpoint is None and not (ca or certificate or key or insecure):
        return None
    network = Network(
        listen=LOOPBACK.listen if endpoint is None else (endpoint,),
        ca=ca,
        certificate=certificate,
        key=key,
        revoked=tuple(revoked),
        insecure=insecure,
    )
    try:
        network.check("")
    except BadInput as error:
        option = error.key.removeprefix("network.")
        flag = f"--{option}" if option in ("ca", "certificate", "key") else "--network"
        expected = error.expected.replace("insecure = true", "--insecure")
        raise BadInput(flag, "", expected) from None
    return network


def _option(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise BadInput("--gateway-set", text, "expected OPTION=VALUE or GROUP.OPTION=VALUE")
    try:
        found = from_toml(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return name.strip(), value.strip()
    return name.strip(), found["value"] if len(found) == 1 else value
