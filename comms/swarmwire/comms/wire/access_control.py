"""zenoh's `access_control` for the robots' network, and for the worlds and routers of a run.

The member at the other end of a link is identified by the common name of its certificate. Messages that no rule allows
are denied without a report: a put arrives nowhere, a query gets no reply. A rule matches only if its keys include the
whole key of a message: a subscription to `radio/*/*` needs a rule for all of these keys, not for one of them.

`access_control` is for a peer of the robots' network. `agents_access`, `observers_access` and `router_access` are for
the endpoints of a run.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys, SwarmKeys, fault_of_name
from swarmwire.comms.wire.network import Network

TRACKER, OPERATOR, WORLD = "tracker", "operator", "world"  # default names on their certificates
ANY = "*"  # any runner, or any run
LOCAL = {"link_protocols": ["unixsock-stream"]}
LIVELINESS = ["liveliness_query", "declare_liveliness_subscriber"]
Right = tuple[list[str], list[str]]  # kinds of messages as zenoh names them, and their allowed keys
Rights = list[tuple[list[str], list[str]]]


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
    _check([*robots, tracker, operator], own, revoked)
    rights = {robot: _rights_of_robot(keys, robot) for robot in robots}
    rights |= {tracker: _rights_of_tracker(keys), operator: _rights_of_operator(keys)}
    members = [name for name in rights if name not in revoked]
    egress = [_rule(f"of own {i}", "egress", right) for i, right in enumerate(rights[own])]
    rules, policies = list(egress), list[dict[str, Any]]()
    for name in members:
        ingress = [_rule(f"{name} {i}", "ingress", right) for i, right in enumerate(rights[name])]
        rules += ingress
        policies.append({"subjects": [name], "rules": [rule["id"] for rule in (*ingress, *egress)]})
    # A subject without names would match every member; so each subject has one name.
    subjects = [{"id": name, "cert_common_names": [name]} for name in members]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rights_of_robot(keys: SwarmKeys, robot: str) -> list[Right]:
    return [
        (["put"], [keys.any_radio_of(robot), keys.bridge_sent(robot)]),
        (["liveliness_token"], [keys.alive(robot)]),
        (["declare_queryable", "reply"], [keys.control(robot)]),
        (["query"], [keys.bridge_join(robot)]),
        (["declare_subscriber"], [keys.any_radio, keys.any_pose, keys.bridge_received(robot)]),
        _liveliness_rights(keys),
    ]


def _rights_of_tracker(keys: SwarmKeys) -> list[Right]:
    return [
        (["put"], [keys.any_pose, keys.bridge_received("*")]),
        (["declare_queryable", "reply"], [keys.any_bridge_join]),
        (["declare_subscriber"], [keys.any_radio, keys.any_bridge_sent]),
        _liveliness_rights(keys),
    ]


def _rights_of_operator(keys: SwarmKeys) -> list[Right]:
    return [
        (["query"], [keys.any_control]),
        (["declare_subscriber"], [keys.any_radio, keys.any_pose]),
        _liveliness_rights(keys),
    ]


def _liveliness_rights(keys: SwarmKeys) -> Right:
    return ["liveliness_query", "declare_liveliness_subscriber"], [keys.alive("*")]


def _rule(name: str, flow: str, right: Right) -> dict[str, Any]:
    messages, keys = right
    return {"id": name, "permission": "allow", "flows": [flow], "messages": messages, "key_exprs": keys}


def _check(names: Sequence[str], own: str, revoked: Collection[str]) -> None:
    for name in names:
        fault = fault_of_name(name)
        if fault is not None:  # a `*` in it would match the keys of all members
            raise BadInput("network", name, fault)
        if names.count(name) > 1:
            raise BadInput("network", name, "expected names that differ: of each robot, of tracker and operator")
    if own not in names:
        raise BadInput("network", own, f"expected the name of a robot, {names[-2]} or {names[-1]}")
    if own in revoked:
        raise BadInput("network", own, "its certificate is revoked: expected a name that is not")


# The endpoints of a run. A unix socket, which only programs of its owner can open, needs no certificate and has the
# rights of any runner or operator.
#
#     runner R    queries offer/R and join/R, is alive/R, puts answer/R, subscribes to frame/R and world
#     observer    sees that the run is published, queries scene and status, subscribes to truth
#     operator    as the observer, and queries control
#     router      at the agents' endpoint the rights of all runners, at the observers' endpoint those of operators
#
# A rule matches whole keys only, so the rules of a runner must include the world's subscription answer/*
# (`any_answer`): with a rule for answer/R alone R would not learn of the subscription, and would send nothing at all.


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
        named = [*self.runners, *self.observers, *self.operators, *self.routers, *self.worlds]
        for name in named:
            fault = fault_of_name(name)
            if fault is not None:  # a `*` in it would match the keys of all members
                raise BadInput(where, name, fault)
            if named.count(name) > 1:
                raise BadInput(where, name, "expected each name once, for one purpose")

    def without_revoked(self) -> "RunAccess":
        """A copy without the revoked names in the other lists."""

        def valid(names: Iterable[str]) -> tuple[str, ...]:
            return tuple(name for name in names if name not in self.revoked)

        return replace(
            self,
            runners=valid(self.runners),
            observers=valid(self.observers),
            operators=valid(self.operators),
            routers=valid(self.routers),
            worlds=valid(self.worlds),
        )


def agents_access(keys: Keys, access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for the agents' endpoint of a world. BadInput for invalid names."""
    access.check()
    access = access.without_revoked()
    rules = _Rules()
    for name in access.runners:
        rules.add(name, _cn(name), ingress=_from_runner(keys, [name]), egress=_to_runner(keys, [name]))
    for name in access.routers:
        rules.add(name, _cn(name), ingress=_from_runner(keys, access.runners), egress=_to_runner(keys, access.runners))
    rules.add("local", LOCAL, ingress=_from_runner(keys, [ANY]), egress=_to_runner(keys, [ANY]))
    return rules.as_mapping()


def observers_access(keys: ObserverKeys, access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for the observers' endpoint of a world. BadInput for invalid names."""
    access.check()
    access = access.without_revoked()
    rules = _Rules()
    for name in access.observers:
        rules.add(name, _cn(name), ingress=_from_observer(keys), egress=_to_observer(keys))
    for name in (*access.operators, *access.routers):
        rules.add(name, _cn(name), ingress=_from_operator(keys), egress=_to_operator(keys))
    rules.add("local", LOCAL, ingress=_from_operator(keys), egress=_to_operator(keys))
    return rules.as_mapping()


def router_access(access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for a router between agents' endpoints of any run and their runners.

    `access` names the routers on both sides of it. BadInput for invalid names.
    """
    access.check()
    access = access.without_revoked()
    keys, rules = Keys(ANY), _Rules()
    from_runners, to_runners = _from_runner(keys, access.runners), _to_runner(keys, access.runners)
    for name in access.runners:
        rules.add(name, _cn(name), ingress=_from_runner(keys, [name]), egress=_to_runner(keys, [name]))
    for name in access.routers:
        rules.add(name, _cn(name), ingress=from_runners + to_runners, egress=to_runners + from_runners)
    for name in access.worlds:
        rules.add(name, _cn(name), ingress=to_runners, egress=from_runners)
    return rules.as_mapping()


def _from_runner(keys: Keys, names: Iterable[str]) -> Rights:
    """The messages that runners of these names send."""
    names = list(names)
    return [
        (["put"], [keys.answer(name) for name in names]),
        (["declare_subscriber"], [keys.frame(name) for name in names]),
        (["query"], [key for name in names for key in (keys.offer(name), keys.join(name))]),
        (["liveliness_token"], [keys.alive(name) for name in names]),
        (LIVELINESS, [keys.world, Keys(ANY).world]),
    ]


def _to_runner(keys: Keys, names: Iterable[str]) -> Rights:
    """The messages that a world sends to runners of these names."""
    names = list(names)
    return [
        (["put"], [keys.frame(name) for name in names]),
        (["declare_subscriber"], [keys.answer(ANY)]),
        (["declare_queryable"], [keys.offer(ANY), keys.join(ANY)]),
        (["reply"], [key for name in names for key in (keys.offer(name), keys.join(name))]),
        (["liveliness_token"], [keys.world]),
        (LIVELINESS, [keys.alive(ANY)]),
    ]


def _from_observer(keys: ObserverKeys) -> Rights:
    return [
        (["declare_subscriber"], [keys.truth]),
        (["query"], [keys.scene, keys.status]),
        (LIVELINESS, [keys.published, ObserverKeys(ANY).published]),
    ]


def _to_observer(keys: ObserverKeys) -> Rights:
    return [
        (["put"], [keys.truth]),
        (["declare_queryable", "reply"], [keys.scene, keys.status]),
        (["liveliness_token"], [keys.published]),
    ]


def _from_operator(keys: ObserverKeys) -> Rights:
    return [*_from_observer(keys), (["query"], [keys.control])]


def _to_operator(keys: ObserverKeys) -> Rights:
    return [*_to_observer(keys), (["declare_queryable", "reply"], [keys.control])]


def _cn(name: str) -> dict[str, Any]:
    return {"cert_common_names": [name]}


class _Rules:
    """A builder of zenoh's rules, subjects and policies; the default is to deny."""

    def __init__(self) -> None:
        self._rules = list[dict[str, Any]]()
        self._subjects = list[dict[str, Any]]()
        self._policies = list[dict[str, Any]]()

    def add(self, name: str, identity: Mapping[str, Any], *, ingress: Rights, egress: Rights) -> None:
        """Add a member: the messages that may come from it, and those that may go to it."""
        ids = list[str]()
        for flow, rights in (("ingress", ingress), ("egress", egress)):
            for i, (messages, keys) in enumerate(rights):
                if keys:
                    ids.append(f"{name} {flow} {i}")
                    rule = {"id": ids[-1], "permission": "allow", "flows": [flow]}
                    self._rules.append({**rule, "messages": messages, "key_exprs": keys})
        self._subjects.append({"id": name, **identity})
        self._policies.append({"subjects": [name], "rules": ids})

    def as_mapping(self) -> dict[str, Any]:
        """The value of zenoh's `access_control`."""
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": self._rules,
            "subjects": self._subjects,
            "policies": self._policies,
        }
