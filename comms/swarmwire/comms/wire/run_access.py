"""Who may send what at the endpoints of a run, as zenoh's `access_control` for its worlds and routers.

The other end of a link is known by the common name of its certificate; a unix socket, which only its owner's programs
can open, needs none and stands for any runner or operator.

    runner R    asks offer/R and join/R, is alive/R, puts answer/R, hears frame/R, and sees whether the world is there
    observer    sees that the run is published, asks scene and status, hears truth
    operator    the same, and asks control
    router      on the agents' endpoint: what the runners may; on the observers': what the operators may

What is not named is refused, silently: a put arrives nowhere, a query gets no answer. A rule holds only if its keys
include the whole key of a message. So a runner must be told of the subscription answer/*, which is the world's own
(`any_answer`): a rule for answer/R alone would keep it from R, who would then send nothing at all.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.network_names import fault_of_name

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
