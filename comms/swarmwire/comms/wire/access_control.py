"""Who may send what in the robots' network, as zenoh's `access_control` for one of its peers.

The other end of a link is known by the common name of its certificate. Each peer judges for itself: what arrives must
be what its sender may send (ingress), and what leaves must be what the peer itself may send, to a member (egress). So
no peer of ours passes on what others sent, and what arrives on a link was made by the name at its other end.

A rule holds only if its keys include the whole key of a message: a subscription to `radio/*/*` needs a rule for all of
these, not for one of them. And whoever may not subscribe at a peer never learns that, nor is sent anything by it.

    robot R     puts radio/R/*, air/R/sent; is alive/R; answers control/R; asks air/R/join;
                hears radio, poses and air/R/received
    tracker     puts pose/*, air/*/received; answers air/*/join; hears radio and air/*/sent
    operator    asks control/*; hears radio and poses
    a name that is revoked, another name, no certificate: nothing

The tracker is a camera system that tells poses, or the world of a run, which tells poses and serves the medium.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys, fault_of_name
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import SwarmKeys

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
    rights |= {tracker: _of_tracker(keys), operator: _of_robots_operator(keys)}
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
        (["put"], [keys.any_radio_of(robot), keys.bridge_sent(robot)]),
        (["liveliness_token"], [keys.alive(robot)]),
        (["declare_queryable", "reply"], [keys.control(robot)]),
        (["query"], [keys.bridge_join(robot)]),
        (["declare_subscriber"], [keys.any_radio, keys.any_pose, keys.bridge_received(robot)]),
        _sees_who_lives(keys),
    ]


def _of_tracker(keys: SwarmKeys) -> list[Right]:
    return [
        (["put"], [keys.any_pose, keys.bridge_received("*")]),
        (["declare_queryable", "reply"], [keys.any_bridge_join]),
        (["declare_subscriber"], [keys.any_radio, keys.any_bridge_sent]),
        _sees_who_lives(keys),
    ]


def _of_robots_operator(keys: SwarmKeys) -> list[Right]:
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


# --- Who may send what at the endpoints of a run, as zenoh's `access_control` for its worlds and routers.
#
# The other end of a link is known by the common name of its certificate; a unix socket, which only its owner's programs
# can open, needs none and stands for any runner or operator.
#
#     runner R    asks offer/R and join/R, is alive/R, puts answer/R, hears frame/R, and sees whether the world is there
#     observer    sees that the run is published, asks scene and status, hears truth
#     operator    the same, and asks control
#     router      on the agents' endpoint: what the runners may; on the observers': what the operators may
#
# What is not named is refused, silently: a put arrives nowhere, a query gets no answer. A rule holds only if its keys
# include the whole key of a message. So a runner must be told of the subscription answer/*, which is the world's own
# (`any_answer`): a rule for answer/R alone would keep it from R, who would then send nothing at all.


WORLD = "world"  # the usual name on the certificate of a machine that runs worlds
ANY = "*"  # any runner; of any run
Rights = list[tuple[list[str], list[str]]]  # messages as zenoh names them, and the keys that they may have
LOCAL = {"link_protocols": ["unixsock-stream"]}
SEES_WHO_LIVES = ["liveliness_query", "declare_liveliness_subscriber"]


@dataclass(frozen=True)
class RunAccess:
    """Names on certificates, by what they are for; a name that is in none of these may do nothing.

    Attributes:
        runners: who may play robots.
        observers: who may look on.
        operators: who may look on and control.
        routers: who passes on what others may. Whoever runs a router could speak for all of those.
        revoked: names that are in another list, and may do nothing any more.
        worlds: whom a router takes for the world. A world itself takes nobody for one.
    """

    runners: tuple[str, ...] = ()
    observers: tuple[str, ...] = ()
    operators: tuple[str, ...] = ()
    routers: tuple[str, ...] = ()
    revoked: tuple[str, ...] = ()
    worlds: tuple[str, ...] = (WORLD,)

    def check(self, where: str = "access") -> None:
        """BadInput for a name that is none, or that stands for two."""
        named = [*self.runners, *self.observers, *self.operators, *self.routers, *self.worlds]
        for name in named:
            fault = fault_of_name(name)
            if fault is not None:  # a `*` in it would be everybody's keys
                raise BadInput(where, name, fault)
            if named.count(name) > 1:
                raise BadInput(where, name, "expected each name once, for one purpose")

    def without_revoked(self) -> "RunAccess":
        """The same, where nobody is left who is revoked."""

        def left(names: Iterable[str]) -> tuple[str, ...]:
            return tuple(name for name in names if name not in self.revoked)

        return replace(
            self,
            runners=left(self.runners),
            observers=left(self.observers),
            operators=left(self.operators),
            routers=left(self.routers),
            worlds=left(self.worlds),
        )


def agents_access(keys: Keys, access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for the agents' endpoint of a world. BadInput for names that will not do."""
    access.check()
    access = access.without_revoked()
    rules = _Rules()
    for name in access.runners:
        rules.add(name, _cn(name), brings=_of_runner(keys, [name]), gets=_to_runner(keys, [name]))
    for name in access.routers:
        rules.add(name, _cn(name), brings=_of_runner(keys, access.runners), gets=_to_runner(keys, access.runners))
    rules.add("local", LOCAL, brings=_of_runner(keys, [ANY]), gets=_to_runner(keys, [ANY]))
    return rules.as_mapping()


def observers_access(keys: ObserverKeys, access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for the observers' endpoint of a world. BadInput for names that will not do."""
    access.check()
    access = access.without_revoked()
    rules = _Rules()
    for name in access.observers:
        rules.add(name, _cn(name), brings=_of_observer(keys), gets=_to_observer(keys))
    for name in (*access.operators, *access.routers):
        rules.add(name, _cn(name), brings=_of_operator(keys), gets=_to_operator(keys))
    rules.add("local", LOCAL, brings=_of_operator(keys), gets=_to_operator(keys))
    return rules.as_mapping()


def router_access(access: RunAccess) -> dict[str, Any]:
    """The value of `access_control` for a router between agents' endpoints of any run and their runners.

    Routers are named in `access` whether they are before it or behind it. BadInput for names that will not do.
    """
    access.check()
    access = access.without_revoked()
    keys, rules = Keys(ANY), _Rules()
    of_runners, to_runners = _of_runner(keys, access.runners), _to_runner(keys, access.runners)
    for name in access.runners:
        rules.add(name, _cn(name), brings=_of_runner(keys, [name]), gets=_to_runner(keys, [name]))
    for name in access.routers:
        rules.add(name, _cn(name), brings=of_runners + to_runners, gets=to_runners + of_runners)
    for name in access.worlds:
        rules.add(name, _cn(name), brings=to_runners, gets=of_runners)
    return rules.as_mapping()


def _of_runner(keys: Keys, names: Iterable[str]) -> Rights:
    """What runners of these names send."""
    names = list(names)
    return [
        (["put"], [keys.answer(name) for name in names]),
        (["declare_subscriber"], [keys.frame(name) for name in names]),
        (["query"], [key for name in names for key in (keys.offer(name), keys.join(name))]),
        (["liveliness_token"], [keys.alive(name) for name in names]),
        (SEES_WHO_LIVES, [keys.world, Keys(ANY).world]),
    ]


def _to_runner(keys: Keys, names: Iterable[str]) -> Rights:
    """What a world sends to runners of these names."""
    names = list(names)
    return [
        (["put"], [keys.frame(name) for name in names]),
        (["declare_subscriber"], [keys.answer(ANY)]),
        (["declare_queryable"], [keys.offer(ANY), keys.join(ANY)]),
        (["reply"], [key for name in names for key in (keys.offer(name), keys.join(name))]),
        (["liveliness_token"], [keys.world]),
        (SEES_WHO_LIVES, [keys.alive(ANY)]),
    ]


def _of_observer(keys: ObserverKeys) -> Rights:
    return [
        (["declare_subscriber"], [keys.truth]),
        (["query"], [keys.scene, keys.status]),
        (SEES_WHO_LIVES, [keys.published, ObserverKeys(ANY).published]),
    ]


def _to_observer(keys: ObserverKeys) -> Rights:
    return [
        (["put"], [keys.truth]),
        (["declare_queryable", "reply"], [keys.scene, keys.status]),
        (["liveliness_token"], [keys.published]),
    ]


def _of_operator(keys: ObserverKeys) -> Rights:
    return [*_of_observer(keys), (["query"], [keys.control])]


def _to_operator(keys: ObserverKeys) -> Rights:
    return [*_to_observer(keys), (["declare_queryable", "reply"], [keys.control])]


def _cn(name: str) -> dict[str, Any]:
    return {"cert_common_names": [name]}


class _Rules:
    """Rules, subjects and policies as they are gathered; what is not named is denied."""

    def __init__(self) -> None:
        self._rules = list[dict[str, Any]]()
        self._subjects = list[dict[str, Any]]()
        self._policies = list[dict[str, Any]]()

    def add(self, name: str, known_by: Mapping[str, Any], *, brings: Rights, gets: Rights) -> None:
        """One member: what may come from it, and what may go to it."""
        ids = list[str]()
        for flow, rights in (("ingress", brings), ("egress", gets)):
            for place, (messages, keys) in enumerate(rights):
                if keys:
                    ids.append(f"{name} {flow} {place}")
                    rule = {"id": ids[-1], "permission": "allow", "flows": [flow]}
                    self._rules.append({**rule, "messages": messages, "key_exprs": keys})
        self._subjects.append({"id": name, **known_by})
        self._policies.append({"subjects": [name], "rules": ids})

    def as_mapping(self) -> dict[str, Any]:
        """As zenoh wants it."""
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": self._rules,
            "subjects": self._subjects,
            "policies": self._policies,
        }
