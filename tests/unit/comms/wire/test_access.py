"""Rights in the robots' network, by name and for members only; `tests/deploy/certificates` tries them on real links."""

from pathlib import Path
from typing import Any

import pytest

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access import access_control, access_of
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.swarm_keys import SwarmKeys

KEYS = SwarmKeys("lab")
ROBOTS = ("flock-0", "flock-1")


def rules_of(access: dict[str, Any], name: str, flow: str) -> list[dict[str, Any]]:
    """The rules that hold between this peer and the other of that name."""
    ids = [rule for policy in access["policies"] if name in policy["subjects"] for rule in policy["rules"]]
    return [rule for rule in access["rules"] if rule["id"] in ids and flow in rule["flows"]]


def keys_put(access: dict[str, Any], name: str, flow: str) -> set[str]:
    return {key for rule in rules_of(access, name, flow) if "put" in rule["messages"] for key in rule["key_exprs"]}


def test_each_name_may_put_its_own_keys():
    access = access_control(KEYS, ROBOTS, "flock-0")
    assert keys_put(access, "flock-1", "ingress") == {KEYS.any_radio_of("flock-1"), KEYS.air_sent("flock-1")}
    assert keys_put(access, "tracker", "ingress") == {KEYS.any_pose, KEYS.air_heard("*")}
    assert keys_put(access, "operator", "ingress") == set()


@pytest.mark.parametrize("other", ["flock-1", "tracker", "operator"])
def test_a_peer_puts_its_own_keys_to_all(other: str):
    access = access_control(KEYS, ROBOTS, "flock-0")
    assert keys_put(access, other, "egress") == {KEYS.any_radio_of("flock-0"), KEYS.air_sent("flock-0")}


def test_all_that_is_not_named_is_refused_and_every_rule_is_of_one_name():
    access = access_control(KEYS, ROBOTS, "tracker")
    assert (access["enabled"], access["default_permission"]) == (True, "deny")
    assert [subject["cert_common_names"] for subject in access["subjects"]] == [
        [name] for name in (*ROBOTS, "tracker", "operator")
    ]
    assert len({rule["id"] for rule in access["rules"]}) == len(access["rules"])


def test_tracker_and_operator_have_the_names_that_they_are_given():
    access = access_control(KEYS, ROBOTS, "flock-0", tracker="vicon", operator="alice")
    assert keys_put(access, "vicon", "ingress") == {KEYS.any_pose, KEYS.air_heard("*")}
    assert not rules_of(access, "tracker", "ingress")
    assert any("query" in rule["messages"] for rule in rules_of(access, "alice", "ingress"))


def test_a_revoked_name_is_in_no_policy():
    access = access_control(KEYS, ROBOTS, "flock-0", revoked=("flock-1", "nobody"))
    assert [subject["id"] for subject in access["subjects"]] == ["flock-0", "tracker", "operator"]
    assert not rules_of(access, "flock-1", "ingress") + rules_of(access, "flock-1", "egress")


def test_settings_without_certificates_have_no_rules_and_others_have_their_names():
    assert access_of(Network(insecure=True), KEYS, ROBOTS, "flock-0") is None
    file = Path("flock-0.pem")
    network = Network(ca=file, certificate=file, key=file, operator="alice", tracker="vicon", revoked=("flock-1",))
    expected = access_control(KEYS, ROBOTS, "flock-0", "vicon", "alice", ("flock-1",))
    assert access_of(network, KEYS, ROBOTS, "flock-0") == expected


@pytest.mark.parametrize(
    ("robots", "own", "revoked", "expected"),
    [
        (("a", "*"), "a", (), "'*'"),
        (("a", "b/c"), "a", (), "'b/c'"),
        (("a", "tracker"), "a", (), "tracker: expected names that differ"),
        (("a", "a"), "a", (), "a: expected names that differ"),
        (("a",), "b", (), "expected the name of a robot, tracker or operator"),
        (("a",), "a", ("a",), "a: its certificate is revoked"),
    ],
)
def test_names_that_would_have_others_rights_are_refused(robots, own, revoked, expected):
    with pytest.raises(BadInput) as refused:
        access_control(KEYS, robots, own, revoked=revoked)
    assert expected in str(refused.value)
