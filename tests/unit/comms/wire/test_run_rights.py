"""Rights at the endpoints of a run, by name; `tests/deploy/certificates` tries them on real links."""

from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.keys import Keys, ObserverKeys
from swarmwire.comms.wire.run_access import RunAccess, agents_access, observers_access, router_access

KEYS, SEEN = Keys("run1"), ObserverKeys("run1")
ACCESS = RunAccess(("a", "b", "gone"), ("wall",), ("alice",), ("gate",), ("gone",))
ANY_RUN = Keys("*")


def keys_of(access: dict[str, Any], name: str, flow: str, message: str) -> set[str]:
    """The keys that this name may have such messages of."""
    ids = [rule for policy in access["policies"] if name in policy["subjects"] for rule in policy["rules"]]
    rules = [rule for rule in access["rules"] if rule["id"] in ids and flow in rule["flows"]]
    return {key for rule in rules if message in rule["messages"] for key in rule["key_exprs"]}


def test_a_runner_speaks_and_hears_for_itself_alone() -> None:
    access = agents_access(KEYS, ACCESS)
    assert keys_of(access, "a", "ingress", "put") == {KEYS.answer("a")}
    assert keys_of(access, "a", "egress", "put") == {KEYS.frame("a")}
    assert keys_of(access, "a", "ingress", "query") == {KEYS.offer("a"), KEYS.join("a")}
    assert keys_of(access, "a", "ingress", "liveliness_token") == {KEYS.alive("a")}


def test_a_router_speaks_for_the_runners_that_are_named_and_a_socket_for_any() -> None:
    access = agents_access(KEYS, ACCESS)
    assert keys_of(access, "gate", "ingress", "put") == {KEYS.answer("a"), KEYS.answer("b")}
    assert keys_of(access, "local", "ingress", "put") == {KEYS.answer("*")}


def test_observers_look_on_and_only_operators_control() -> None:
    access = observers_access(SEEN, ACCESS)
    for name in ("wall", "alice", "gate", "local"):
        assert keys_of(access, name, "egress", "put") == {SEEN.truth}
        assert keys_of(access, name, "ingress", "put") == set()
        controls = SEEN.control in keys_of(access, name, "ingress", "query")
        assert controls == (name != "wall")
        assert (SEEN.control in keys_of(access, name, "egress", "reply")) == controls


def test_a_router_lets_the_world_tell_and_runners_answer_and_never_the_other_way_round() -> None:
    access = router_access(ACCESS)
    assert keys_of(access, "world", "ingress", "put") == {ANY_RUN.frame("a"), ANY_RUN.frame("b")}
    assert keys_of(access, "world", "egress", "put") == {ANY_RUN.answer("a"), ANY_RUN.answer("b")}
    assert keys_of(access, "a", "ingress", "put") == {ANY_RUN.answer("a")}
    both = keys_of(access, "world", "ingress", "put") | keys_of(access, "world", "egress", "put")
    assert keys_of(access, "gate", "ingress", "put") == both


@pytest.mark.parametrize("access", [agents_access(KEYS, ACCESS), observers_access(SEEN, ACCESS), router_access(ACCESS)])
def test_what_is_not_named_is_refused_and_who_is_revoked_is_not_named(access: dict[str, Any]) -> None:
    assert access["default_permission"] == "deny"
    assert {rule["permission"] for rule in access["rules"]} == {"allow"}
    assert "gone" not in str(access)


@pytest.mark.parametrize(
    ("access", "fault"),
    [
        (RunAccess(runners=("*",)), "access"),
        (RunAccess(runners=("a/b",)), "access"),
        (RunAccess(runners=("a",), operators=("a",)), "expected each name once, for one purpose"),
        (RunAccess(runners=("world",)), "expected each name once, for one purpose"),
    ],
)
def test_names_that_are_none_or_stand_for_two_are_refused_everywhere(access: RunAccess, fault: str) -> None:
    for refuses in (lambda: agents_access(KEYS, access), lambda: observers_access(SEEN, access)):
        with pytest.raises(BadInput, match=fault):
            refuses()
    with pytest.raises(BadInput, match=fault):
        router_access(access)
