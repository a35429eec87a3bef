"""zenoh's `access_control` for the robots' network, and for the worlds and routers of a run.

The member at the other end of a link is identified by the common name of its certificate. Messages that no rule allows
are denied without a report: a put arrives nowhere, a query gets no reply. A rule matches only if its keys include the
whole key of a message: a subscription to `radio/*/*` needs a rule for all of these keys, not for one of them.

`access_control` is for a peer of the robots' network. `agents_access`, `observers_access` and `router_access` are for
the endpoints of a run.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, cast

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys, SwarmKeys, fault_of_name
from swarmwire.comms.wire.network import Network

TRACKER, OPERATOR, WORLD = "tracker", "operator", "world"  # default names on their certificates
ANY = "*"  # any runner, or any run
LIVELINESS = "liveliness_query declare_liveliness_subscriber"
ANSWERS = "declare_queryable reply"
Rights = list[tuple[str, list[str]]]  # kinds of messages as zenoh names them, and their allowed keys


class Member(NamedTuple):
    """The member at the other end of a link: the messages that may come from it, and those that may go to it."""

    sends: Rights
    receives: Rights


def _rules(members: Mapping[str, Member], local: Member | None = None) -> dict[str, Any]:
    """The value of `access_control` for members by the names on their certificates.

    `local` are programs of this machine that connect by a unix socket, which needs no certificate.
    """
    # A subject without names would match every member; so each subject has one name.
    subjects: list[dict[str, Any]] = [{"id": name, "cert_common_names": [name]} for name in members]
    if local is not None:
        subjects.append({"id": "local", "link_protocols": ["unixsock-stream"]})
        members = {**members, "local": local}
    ids = dict[tuple[str, str, tuple[str, ...]], str]()  # of each rule, which members share
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
    """BadInput for an invalid name, and with `expected` for a repeated one."""
    for name in names:
        fault = fault_of_name(name)
        if fault is not None:  # a `*` in it would match the keys of all members
            raise BadInput(where, name, fault)
        if names.count(name) > 1:
            raise BadInput(where, name, expected)


# The robots' network. Each peer checks for itself: a message that arrives must be one that its sender may send
# (ingress), and a message that leaves must be one that the peer itself may send to a member (egress). So no peer passes
# on messages of others, and the member at the other end of a link is the author of the messages that arrive on it. A
# member that may not subscribe at a peer gets no error, and no messages.
#
#     robot R     puts radio/R/*, bridge/R/sent; is alive/R; answers control/R; queries bridge/R/join;
#                 subscribes to radio, poses and bridge/R/received
#     tracker     puts pose/*, bridge/*/received; answers bridge/*/join; subscribes to radio and bridge/*/sent
#     operator    queries control/*; subscribes to radio and poses
#     a revoked name, another name, no certificate: no rights
#
# The tracker is a camera system that publishes poses, or the world of a run, which publishes poses and serves the radio
# medium.


def access_of(network: Network, keys: SwarmKeys, robots: Sequence[str], own: str) -> dict[str, Any] | None:
    """`access_control` by these settings; None without certificates, which identify the other end of a link."""
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
    """The value of `access_control` for the peer whose certificate has the name `own`.

    `robots` are all names in the swarm. BadInput for an invalid or repeated name, or if `own` is unknown or revoked.
    """
    names = [*robots, tracker, operator]
    _check_names(names, "network", "expected names that differ: of each robot, of tracker and operator")
    if own not in names:
        raise BadInput("network", own, f"expected the name of a robot, {tracker} or {operator}")
    if own in revoked:
        raise BadInput("network", own, "its certificate is revoked: expected a name that is not")
    rights = {robot: _rights_of_robot(keys, robot) for robot in robots}
    rights |= {tracker: _rights_of_tracker(keys), operator: _rights_of_operator(keys)}
    return _rules({name: Member(rights[name], rights[own]) for name in names if name not in revoked})


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


# The endpoints of a run. A unix socket, which only programs of its owner can open, needs no certificate and has the
# rights of any runner or operator.
#
#     runner R    queries session_info/R and join/R, is alive/R, puts answer/R, subscribes to frame/R and world
#     observer    sees that the run is published, queries scene and status, subscribes to truth
#     operator    as the observer, and queries control
#     router      at the agents' endpoint the rights of all runners, at the observers' endpoint those of operators
#
# A rule matches whole keys only, so the rules of a runner must include the world's subscription answer/*
# (`any_answer`): with a rule for answer/R alone R would not learn of the subscription, and would send nothing at all.

ROLES = ("runners", "observers", "operators", "routers", "worlds")


@dataclass(frozen=True)
class RunAccess:
    """Names on certificates by role; a name in none of these has no rights.

    Attributes:
        runners: members that may run robots.
        observers: members that may watch the run.
        operators: members that may watch and control the run.
        routers: members that pass on the messages of others. A router could impersonate all of those.
        revoked: names in another list that have no rights any more.
        worlds: members that a router accepts as the world. A world itself accepts none.
    """

    runners: tuple[str, ...] = ()
    observers: tuple[str, ...] = ()
    operators: tuple[str, ...] = ()
    routers: tuple[str, ...] = ()
    revoked: tuple[str, ...] = ()
    worlds: tuple[str, ...] = (WORLD,)

    def check(self, where: str = "access") -> None:
        """BadInput for an invalid or repeated name."""
        names = [name for role in ROLES for name in cast("tuple[str, ...]", getattr(self, role))]
        _check_names(names, where, "expected each name once, for one purpose")

    def without_revoked(self) -> "RunAccess":
        """A copy without the revoked names in the other lists."""
        named = {role: cast("tuple[str, ...]", getattr(self, role)) for role in ROLES}
        return replace(
            self, **{role: tuple(name for name in names if name not in self.revoked) for role, names in named.items()}
        )

    def valid(self) -> "RunAccess":
        """`without_revoked`, after a `check`."""
        self.check()
        return self.without_revoked()


def agents_access(keys: Keys, access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for the agents' endpoint of a world. BadInput for invalid names."""
    access = access.valid()
    members = {name: _runners(keys, [name]) for name in access.runners}
    members |= dict.fromkeys(access.routers, _runners(keys, access.runners))
    return _rules(members, local=_runners(keys, [ANY]))


def observers_access(keys: ObserverKeys, access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for the observers' endpoint of a world. BadInput for invalid names."""
    access = access.valid()
    observer = _observer(keys, [keys.scene, keys.status])
    operator = _observer(keys, [keys.scene, keys.status, keys.control])
    members = dict.fromkeys(access.observers, observer)
    return _rules(members | dict.fromkeys((*access.operators, *access.routers), operator), local=operator)


def router_access(access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for a router between agents' endpoints of any run and their runners.

    `access` names the routers on both sides of it. BadInput for invalid names.
    """
    access = access.valid()
    keys = Keys(ANY)
    from_runners, to_runners = _runners(keys, access.runners)
    members = {name: _runners(keys, [name]) for name in access.runners}
    members |= dict.fromkeys(access.routers, Member(from_runners + to_runners, to_runners + from_runners))
    return _rules(members | dict.fromkeys(access.worlds, Member(to_runners, from_runners)))


def _runners(keys: Keys, names: Iterable[str]) -> Member:
    """The messages between a world and runners of these names."""
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
    """The messages between a world and an observer that may query these keys."""
    return Member(
        sends=[
            ("declare_subscriber", [keys.truth]),
            ("query", queries),
            (LIVELINESS, [keys.published, ObserverKeys(ANY).published]),
        ],
        receives=[("put", [keys.truth]), (ANSWERS, queries), ("liveliness_token", [keys.published])],
    )
