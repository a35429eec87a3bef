"""Who may send what in the robots' network, as zenoh's `access_control` for one of its peers.

The other end of a link is known by the common name of its certificate. Each peer judges for itself: what arrives must
be what its sender may send (ingress), and what leaves must be what the peer itself may send, to a member (egress). So
no peer of ours passes on what others sent, and what arrives on a link was made by the name at its other end.

A rule holds only if its keys include the whole key of a message: a subscription to `radio/*/*` needs a rule for all of
these, not for one of them. And whoever may not subscribe at a peer never learns that, nor is sent anything by it.

    robot R     puts radio/R/*, air/R/sent; is alive/R; answers control/R; asks air/R/join;
                hears radio, poses and air/R/heard
    tracker     puts pose/*, air/*/heard; answers air/*/join; hears radio and air/*/sent
    operator    asks control/*; hears radio and poses
    a name that is revoked, another name, no certificate: nothing

The tracker is a camera system that tells poses, or the world of a run, which tells poses and serves the air.
"""

from collections.abc import Collection, Sequence
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.network_names import fault_of_name
from swarmwire.comms.wire.swarm_keys import SwarmKeys

TRACKER, OPERATOR = "tracker", "operator"  # the usual names on their certificates
Right = tuple[list[str], list[str]]  # messages as zenoh names them, and the keys that they may have


def access_of(network: Network, keys: SwarmKeys, robots: Sequence[str], own: str) -> dict[str, Any] | None:
    """`access_control` by these settings; None without certificates, when nobody can tell who is at the other end."""
    if not network.proves:
        return None
    return access_control(keys, robots, own, network.tracker, network.operator, network.revoked)


def access_control(
    keys: SwarmKeys,
    robots: Sequence[str],
    own: str,
    tracker: str = TRACKER,
    operator: str = OPERATOR,
    revoked: Collection[str] = (),
) -> dict[str, Any]:
    """The value of `access_control` for the peer whose certificate is on `own`: what is not named is refused.

    `robots` are all names in the swarm. Refusals are silent: a put that is refused arrives nowhere, a query gets no
    answer. BadInput for a name that is none, that stands for two, or if `own` is unknown or revoked.
    """
    _check([*robots, tracker, operator], own, revoked)
    rights = {robot: _of_robot(keys, robot) for robot in robots}
    rights |= {tracker: _of_tracker(keys), operator: _of_operator(keys)}
    members = [name for name in rights if name not in revoked]
    may_send = [_rule(f"of own {place}", "egress", right) for place, right in enumerate(rights[own])]
    rules, policies = list(may_send), list[dict[str, Any]]()
    for name in members:
        may_bring = [_rule(f"{name} {place}", "ingress", right) for place, right in enumerate(rights[name])]
        rules += may_bring
        policies.append({"subjects": [name], "rules": [rule["id"] for rule in (*may_bring, *may_send)]})
    # A subject without names would be everybody; one name each, and there is no list that may be empty.
    subjects = [{"id": name, "cert_common_names": [name]} for name in members]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _of_robot(keys: SwarmKeys, robot: str) -> list[Right]:
    return [
        (["put"], [keys.any_radio_of(robot), keys.air_sent(robot)]),
        (["liveliness_token"], [keys.alive(robot)]),
        (["declare_queryable", "reply"], [keys.control(robot)]),
        (["query"], [keys.air_join(robot)]),
        (["declare_subscriber"], [keys.any_radio, keys.any_pose, keys.air_heard(robot)]),
        _sees_who_lives(keys),
    ]


def _of_tracker(keys: SwarmKeys) -> list[Right]:
    return [
        (["put"], [keys.any_pose, keys.air_heard("*")]),
        (["declare_queryable", "reply"], [keys.any_air_join]),
        (["declare_subscriber"], [keys.any_radio, keys.any_air_sent]),
        _sees_who_lives(keys),
    ]


def _of_operator(keys: SwarmKeys) -> list[Right]:
    return [
        (["query"], [keys.any_control]),
        (["declare_subscriber"], [keys.any_radio, keys.any_pose]),
        _sees_who_lives(keys),
    ]


def _sees_who_lives(keys: SwarmKeys) -> Right:
    return ["liveliness_query", "declare_liveliness_subscriber"], [keys.alive("*")]


def _rule(name: str, flow: str, right: Right) -> dict[str, Any]:
    messages, keys = right
    return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}


def _check(names: Sequence[str], own: str, revoked: Collection[str]) -> None:
    for name in names:
        fault = fault_of_name(name)
        if fault is not None:  # a `*` in it would be everybody's keys
            raise BadInput("network", name, fault)
        if names.count(name) > 1:
            raise BadInput("network", name, "expected names that differ: of each robot, of tracker and operator")
    if own not in names:
        raise BadInput("network", own, f"expected the name of a robot, {names[-2]} or {names[-1]}")
    if own in revoked:
        raise BadInput("network", own, "its certificate is revoked: expected a name that is not")
