"""zenoh's `access_control` for the robots' network, and for the worlds and routers of a run.

The member at the other end of a link is identified by the common name of its certificate. Messages that no rule allows
are denied without a report: a put arrives nowhere, a query gets no reply. A rule matches only if its keys include all
keys of a message: a subscription to `radio/*/*` needs a rule for `radio/*/*`; rules for single keys do not match.

`access_control` is for a peer of the robots' network. `agents_access`, `observers_access` and `router_access` are for
the endpoints of a run.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys, SwarmKeys, fault_of_name
from swarmwire.comms.wire.network import Network

TRACKER, OPERATOR, WORLD = "tracker", "operator", "world"  # default names on the certificates of these members
ANY = "*"  # any runner, or any run
LIVELINESS = "liveliness_query declare_liveliness_subscriber"
ANSWERS = "declare_queryable reply"
Rights = list[tuple[str, list[str]]]  # kinds of messages as zenoh names them, and their allowed keys


class Member(NamedTuple):
    """Rights of the member at the other end of a link: the messages that it may send, and those that it may receive."""

    sends: Rights
    receives: Rights


def _rules(members: Mapping[str, Member], local: Member | None = None) -> dict[str, Any]:
    """Return the value of `access_control` for members by the names on their certificates.

    `local` are the rights of programs of this machine that connect by a unix socket, which needs no certificate.
    """
    # Each subject has a name, since a subject without names would match every member.
    subjects: list[dict[str, Any]] = [{"id": name, "cert_common_names": [name]} for name in members]
    if local is not None:
        subjects.append({"id": "local", "link_protocols": ["unixsock-stream"]})
        members = {**members, "local": local}
    ids = dict[tuple[str, str, tuple[str, ...]], str]()  # (flow, messages, keys) of a rule: its id
    policies = list[dict[str, Any]]()
    for name, member in members.items():
        rights = [("ingress", *right) for right in member.sends] + [("egress", *right) for right in member.receives]
        rules = [
            ids.setdefault((flow, messages, tuple(keys)), f"{flow} {len(ids)}")
            for flow, messages, keys in rights
            if keys
        ]
        policies.append({"subjects": [name], "rules": rules})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {"id": id_, "permission": "allow", "flows": [flow], "messages": messages.split(), "key_exprs": list(keys)}
            for (flow, messages, keys), id_ in ids.items()
        ],
        "subjects": subjects,
        "policies": policies,
    }


def _check_names(names: Sequence[str], where: str, expected: str) -> None:
    """Raise BadInput for an invalid name, and with `expected` for a repeated name."""
    for name in names:
        fault = fault_of_name(name)
        if fault is not None:  # a name with a `*` would match the keys of all members
            raise BadInput(where, name, fault)
        if names.count(name) > 1:
            raise BadInput(where, name, expected)


# The robots' network. Each peer checks the messages that arrive (ingress) against the rights of their sender, and the
# messages that it sends (egress) against its rights towards the receiver. Thus no peer forwards messages of others, and
# the member at the other end of a link is the author of the messages that arrive on it. A member that may not subscribe
# at a peer gets no error, and no messages.
#
#     robot R     puts radio/R/*, bridge/R/sent; is alive/R; answers control/R; queries bridge/R/join;
#                 subscribes to radio, poses and bridge/R/received
#     tracker     puts pose/*, bridge/*/received; answers bridge/*/join; subscribes to radio and bridge/*/sent
#     operator    queries control/*; subscribes to radio and poses
#     a revoked name, another name, no certificate: no rights
#
# The tracker is a camera system that publishes poses, or the world of a run, which publishes poses and serves the radio
# medium.


def access_of(network: Network, keys: SwarmKeys, robots: Sequence[str], name: str) -> dict[str, Any] | None:
    """Return `access_control` for these settings; None without certificates, which identify the other end of a link."""
    if not network.proves:
        return None
    return access_control(keys, robots, name, network.tracker, network.operator, network.revoked)


def access_control(
    keys: SwarmKeys,
    robots: Sequence[str],
    name: str,
    tracker: str = TRACKER,
    operator: str = OPERATOR,
    revoked: Collection[str] = (),
) -> dict[str, Any]:
    """Return the value of `access_control` for the peer with the certificate name `name`.

    `robots` are all robots of the swarm. BadInput for an invalid or repeated name, or if `name` is unknown or revoked.
    """
    members = [*robots, tracker, operator]
    _check_names(members, "network", "expected names that differ: of each robot, of tracker and operator")
    if name not in members:
        raise BadInput("network", name, f"expected the name of a robot, {tracker} or {operator}")
    if name in revoked:
        raise BadInput("network", name, "its certificate is revoked: expected a name that is not")
    rights = {robot: _rights_of_robot(keys, robot) for robot in robots}
    rights |= {tracker: _rights_of_tracker(keys), operator: _rights_of_operator(keys)}
    return _rules({member: Member(rights[member], rights[name]) for member in members if member not in revoked})


def _rights_of_robot(keys: SwarmKeys, robot: str) -> Rights:
    return [
        ("put", [keys.any_radio_of(robot), keys.bridge_sent(robot)]),
        ("liveliness_token", [keys.alive(robot)]),
        (ANSWERS, [keys.control(robot)]),
        ("query", [keys.bridge_join(robot)]),
        ("declare_subscriber", [keys.any_radio, keys.any_pose, keys.bridge_received(robot)]),
        (LIVELINESS, [keys.alive(ANY)]),
    ]


def _rights_of_tracker(keys: SwarmKeys) -> Rights:
    return [
        ("put", [keys.any_pose, keys.bridge_received(ANY)]),
        (ANSWERS, [keys.any_bridge_join]),
        ("declare_subscriber", [keys.any_radio, keys.any_bridge_sent]),
        (LIVELINESS, [keys.alive(ANY)]),
    ]


def _rights_of_operator(keys: SwarmKeys) -> Rights:
    return [
        ("query", [keys.any_control]),
        ("declare_subscriber", [keys.any_radio, keys.any_pose]),
        (LIVELINESS, [keys.alive(ANY)]),
    ]


# The endpoints of a run. Programs that connect by a unix socket, which only its owner can open, need no certificate and
# have the rights of any runner or operator.
#
#     runner R    queries session_info/R and join/R, is alive/R, puts answer/R, subscribes to frame/R and world
#     observer    sees that the run is published, queries scene and status, subscribes to truth
#     operator    as the observer, and queries control
#     router      at the agents' endpoint the rights of all runners, at the observers' endpoint those of operators
#
# The rules of a runner must include the world's subscription answer/* (`any_answer`): with a rule for answer/R alone, R
# would not learn of the subscription and would send nothing.

ROLES = ("runners", "observers", "operators", "routers", "worlds")


@dataclass(frozen=True)
class RunAccess:
    """Names on certificates by role; a name in none of these has no rights.

    Attributes:
        runners: members that may run robots.
        observers: members that may watch the run.
        operators: members that may watch and control the run.
        routers: members that forward the messages of others. A router could impersonate all of them.
        revoked: names without rights, although they are in other lists.
        worlds: members that a router accepts as the world. A world itself accepts none.
    """

    runners: tuple[str, ...] = ()
    observers: tuple[str, ...] = ()
    operators: tuple[str, ...] = ()
    routers: tuple[str, ...] = ()
    revoked: tuple[str, ...] = ()
    worlds: tuple[str, ...] = (WORLD,)

    def check(self, where: str = "access") -> None:
        """Raise BadInput for an invalid or repeated name."""
        names = [name for role in ROLES for name in cast("tuple[str, ...]", getattr(self, role))]
        _check_names(names, where, "expected each name once, for one purpose")

    def without_revoked(self) -> "RunAccess":
        """Return a copy without the revoked names in the other lists."""
        members = {role: cast("tuple[str, ...]", getattr(self, role)) for role in ROLES}
        valid = {role: tuple(name for name in names if name not in self.revoked) for role, names in members.items()}
        return replace(self, **valid)

    def valid(self) -> "RunAccess":
        """Check the names and return a copy `without_revoked`."""
        self.check()
        return self.without_revoked()


def agents_access(keys: Keys, access: RunAccess) -> dict[str, Any]:
    """Return the value of `access_control` for the agents' endpoint of a world. BadInput for invalid names."""
    access = access.valid()
    members = {name: _runners(keys, [name]) for name in access.runners}
    members |= dict.fromkeys(access.routers, _runners(keys, access.runners))
    return _rules(members, local=_runners(keys, [ANY]))


def observers_access(keys: ObserverKeys, access: RunAccess) -> dict[str, Any]:
    """Return the value of `access_control` for the observers' endpoint of a world. BadInput for invalid names."""
    access = access.valid()
    observer = _observer(keys, [keys.scene, keys.status])
    operator = _observer(keys, [keys.scene, keys.status, keys.control])
    members = dict.fromkeys(access.observers, observer)
    return _rules(members | dict.fromkeys((*access.operators, *access.routers), operator), local=operator)


def router_access(access: RunAccess) -> dict[str, Any]:
    """Return the value of `access_control` for a router between agents' endpoints of any run and their runners.

    `access` names the routers on both sides of it. BadInput for invalid names.
    """
    access = access.valid()
    keys = Keys(ANY)
    from_runners, to_runners = _runners(keys, access.runners)
    members = {name: _runners(keys, [name]) for name in access.runners}
    members |= dict.fromkeys(access.routers, Member(from_runners + to_runners, to_runners + from_runners))
    return _rules(members | dict.fromkeys(access.worlds, Member(to_runners, from_runners)))


def _runners(keys: Keys, names: Iterable[str]) -> Member:
    """Return the rights of a link between a world and runners of these names."""
    names = list(names)
    joins = [key for name in names for key in (keys.session_info(name), keys.join(name))]
    return Member(
        sends=[
            ("put", [keys.answer(name) for name in names]),
            ("declare_subscriber", [keys.frame(name) for name in names]),
            ("query", joins),
            ("liveliness_token", [keys.alive(name) for name in names]),
            (LIVELINESS, [keys.world, Keys(ANY).world]),
        ],
        receives=[
            ("put", [keys.frame(name) for name in names]),
            ("declare_subscriber", [keys.answer(ANY)]),
            ("declare_queryable", [keys.session_info(ANY), keys.join(ANY)]),
            ("reply", joins),
            ("liveliness_token", [keys.world]),
            (LIVELINESS, [keys.alive(ANY)]),
        ],
    )


def _observer(keys: ObserverKeys, queries: list[str]) -> Member:
    """Return the rights of a link between a world and an observer that may query these keys."""
    return Member(
        sends=[
            ("declare_subscriber", [keys.truth]),
            ("query", queries),
            (LIVELINESS, [keys.published, ObserverKeys(ANY).published]),
        ],
        receives=[("put", [keys.truth]), (ANSWERS, queries), ("liveliness_token", [keys.published])],
    )
