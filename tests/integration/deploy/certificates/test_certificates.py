"""Certificates: OpenSSL agrees, robots prove themselves, a run with gateways."""

import shutil
import subprocess
from collections.abc import Generator
from contextlib import ExitStack
from pathlib import Path
from shutil import copy

import pytest
import zenoh

from swarmwire.comms.base.clock import WallClock
from swarmwire.comms.wire.access_control import access_of
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import open_swarm
from swarmwire.comms.wire.sessions import close_session, closed_after
from swarmwire.deploy import Recording, Simulation
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.register import certificate_request
from swarmwire.deploy.runs.gateways.gateways import Gateways
from tests.support.deploy.certificates import (
    KEYS,
    PATIENT_MS,
    REFUSED_MS,
    ROBOTS,
    DatedFakeClock,
    Inbox,
    Links,
    at_once,
    endpoint_of,
    network_of,
    replies_of,
    stranger,
    wait_for_listeners,
)
from tests.support.deploy.gateways import DrivenRobots

ADDRESSES = ("127.0.0.1",)
EVERYTHING = (KEYS.any_radio, KEYS.any_pose, KEYS.bridge_received("flock-0"))
SCENARIO = Path(__file__).parents[4] / "scenarios" / "robots" / "flocking-epuck2.toml"
FLOCK = ("flock-0", "flock-1")
SHORT = ("robots.flock.count=2", "duration_s=3", "radio.loss=0")


def test_git_ignores_the_ca(tmp_path: Path):
    begin_authority(tmp_path / "ca", WallClock())
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    command = ["git", "-C", tmp_path, "status", "--porcelain"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout == ""


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl is not installed")
def test_openssl_verifies_certificates_with_their_hosts(tmp_path: Path):
    folder = tmp_path / "ca"
    begin_authority(folder, WallClock())
    issue(folder, [certificate_request("flock-0", ("10.0.0.5",))], 30, WallClock())

    def verified(name: str, *more: str) -> bool:
        command = ["openssl", "verify", "-x509_strict", "-CAfile", "ca.pem", *more]
        return not subprocess.run([*command, f"{name}.pem"], cwd=folder, capture_output=True, check=False).returncode

    assert verified("flock-0", "-purpose", "sslserver", "-verify_ip", "10.0.0.5")
    assert verified("flock-0", "-purpose", "sslclient", "-verify_hostname", "flock-0")
    assert not verified("flock-0", "-verify_ip", "10.0.0.6")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A CA, and certificates of three robots and their company."""
    folder = tmp_path_factory.mktemp("lab") / "ca"
    begin_authority(folder, WallClock())
    issue(folder, [certificate_request(name, ADDRESSES) for name in (*ROBOTS, "tracker", "operator")], 1, WallClock())
    return folder


@pytest.fixture
def opened() -> Generator[ExitStack]:
    """Whatever a test opens is closed after it, last first."""
    with ExitStack() as stack:
        yield stack


def ours(folder: Path, name: str, *others: zenoh.Session, revoked: tuple[str, ...] = ()) -> zenoh.Session:
    """A peer that is linked with all others and has our rules."""
    network = network_of(folder, name, *others, revoked=revoked)
    return open_swarm(network, access_of(network, KEYS, ROBOTS, name), small=False)


def lawless(folder: Path, name: str, *others: zenoh.Session) -> zenoh.Session:
    """A peer with a member's certificate and without rules: software of somebody else's."""
    return open_swarm(network_of(folder, name, *others), small=False)


def test_robots_receive_one_another_and_no_forged_sender(folder: Path, opened: ExitStack):
    """The forged ones are sent first on the same link, so they would have been received first."""
    listener = opened.enter_context(closed_after(ours(folder, "flock-0")))
    inbox = Inbox(listener, *EVERYTHING)
    speaker = opened.enter_context(closed_after(ours(folder, "flock-1", listener)))
    forger = opened.enter_context(closed_after(lawless(folder, "flock_2", listener, speaker)))
    own_keys = KEYS.radio("flock-1", 1), KEYS.radio("flock_2", 1)
    wait_for_listeners(speaker, own_keys[0])
    speaker.put(own_keys[0], b"")
    assert inbox.next() == own_keys[0]
    forged = own_keys[0], KEYS.radio("flock-0", 1), KEYS.pose("flock_2"), KEYS.bridge_received("flock-0")
    for key in (*forged, own_keys[1]):
        wait_for_listeners(forger, key)
        forger.put(key, b"")
    assert inbox.next() == own_keys[1]
    assert inbox.empty()


def test_forbidden_messages_do_not_leave_a_peer(folder: Path, opened: ExitStack):
    listener = opened.enter_context(closed_after(lawless(folder, "flock-1")))
    inbox = Inbox(listener, *EVERYTHING)
    speaker = opened.enter_context(closed_after(ours(folder, "flock-0", listener)))
    wait_for_listeners(speaker, KEYS.radio("flock-0", 1))
    for key in (KEYS.radio("flock-1", 1), KEYS.pose("flock-0"), KEYS.radio("flock-0", 1)):
        speaker.put(key, b"")
    assert inbox.next() == KEYS.radio("flock-0", 1)
    assert inbox.empty()


def test_peer_forwards_nothing(folder: Path, opened: ExitStack):
    """Peers do so for clients, as whose link the peer's own would then be taken."""
    listener = opened.enter_context(closed_after(lawless(folder, "flock-1")))
    inbox = Inbox(listener, *EVERYTHING)
    between = opened.enter_context(closed_after(ours(folder, "flock-0", listener)))
    arrived = Inbox(between, KEYS.any_radio)
    wait_for_listeners(between, KEYS.radio("flock-0", 1))
    client = opened.enter_context(closed_after(stranger(endpoint_of(between), folder, (folder, "flock_2"), PATIENT_MS)))
    wait_for_listeners(client, KEYS.radio("flock_2", 1))
    client.put(KEYS.radio("flock_2", 1), b"")
    assert arrived.next() == KEYS.radio("flock_2", 1)
    between.put(KEYS.radio("flock-0", 1), b"")
    assert inbox.next() == KEYS.radio("flock-0", 1)


def test_poses_are_accepted_from_the_tracker_alone(folder: Path, opened: ExitStack):
    robot = opened.enter_context(closed_after(ours(folder, "flock-0")))
    inbox = Inbox(robot, *EVERYTHING)
    tracker = opened.enter_context(closed_after(lawless(folder, "tracker", robot)))
    for key in (KEYS.radio("flock-1", 1), KEYS.pose("flock-0"), KEYS.bridge_received("flock-0")):
        wait_for_listeners(tracker, key)
        tracker.put(key, b"")
    assert [inbox.next(), inbox.next()] == [KEYS.pose("flock-0"), KEYS.bridge_received("flock-0")]
    assert inbox.empty()


@pytest.mark.parametrize(("name", "replies"), [("operator", ["yes"]), ("tracker", []), ("flock-1", [])])
def test_control_requests_of_the_operator_alone_are_answered(
    folder: Path, opened: ExitStack, name: str, replies: list[str]
):
    robot = opened.enter_context(closed_after(ours(folder, "flock-0")))
    control = KEYS.control("flock-0")
    robot.declare_queryable(control, lambda query: query.reply(control, b"yes"))
    robot.declare_subscriber(KEYS.any_radio, lambda _: None)
    asking = opened.enter_context(closed_after(lawless(folder, name, robot)))
    wait_for_listeners(asking, KEYS.any_radio)
    assert replies_of(asking, control, wait=bool(replies)) == replies


def test_robot_gets_its_own_link_terms_from_the_world(folder: Path, opened: ExitStack):
    world = opened.enter_context(closed_after(ours(folder, "tracker")))
    world.declare_queryable(KEYS.any_bridge_join, lambda query: query.reply(query.key_expr, b"yes"))
    robot = opened.enter_context(closed_after(ours(folder, "flock-0", world)))
    assert replies_of(robot, KEYS.bridge_join("flock-0"), wait=True) == ["yes"]
    assert replies_of(robot, KEYS.bridge_join("flock-1"), wait=False) == []


def test_revoked_name_is_received_only_by_peers_without_its_revocation(folder: Path, opened: ExitStack):
    robot = opened.enter_context(closed_after(ours(folder, "flock-0", revoked=("flock-1",))))
    unaware = opened.enter_context(closed_after(ours(folder, "flock_2")))
    inboxes, links = [Inbox(session, *EVERYTHING) for session in (robot, unaware)], Links(robot)
    tokens = list[str]()
    robot.liveliness().declare_subscriber(KEYS.alive("*"), at_once(lambda sample: tokens.append(str(sample.key_expr))))
    revoked = lawless(folder, "flock-1", robot, unaware)
    links.wait(up=True)
    revoked.liveliness().declare_token(KEYS.alive("flock-1"))
    wait_for_listeners(revoked, KEYS.radio("flock-1", 1))
    revoked.put(KEYS.radio("flock-1", 1), b"")
    assert inboxes[1].next() == KEYS.radio("flock-1", 1)
    close_session(revoked)
    links.wait(up=False)  # all that it sent has come before
    assert inboxes[0].empty()
    assert not tokens


def test_certificates_of_another_ca_are_refused(folder: Path, opened: ExitStack, tmp_path: Path):
    foreign = tmp_path / "foreign"
    begin_authority(foreign, WallClock())
    issue(foreign, [certificate_request("flock-1", ADDRESSES)], 1, WallClock())
    endpoint = endpoint_of(opened.enter_context(closed_after(ours(folder, "flock-0"))))
    close_session(stranger(endpoint, folder, (folder, "flock-1"), PATIENT_MS))
    in_plain_text = endpoint.replace("tls/", "tcp/")
    for where, certificate in ((endpoint, (foreign, "flock-1")), (endpoint, None), (in_plain_text, None)):
        with pytest.raises(zenoh.ZError):
            stranger(where, folder, certificate, REFUSED_MS)


def test_expired_certificate_is_refused(opened: ExitStack, tmp_path: Path):
    folder, past = tmp_path / "ca", DatedFakeClock("2026-02-01T00:00:00Z")
    begin_authority(folder, past)
    issue(folder, [certificate_request("flock-0", ADDRESSES)], 3000, past)
    issue(folder, [certificate_request("flock-1", ADDRESSES)], 1, past)
    endpoint = endpoint_of(opened.enter_context(closed_after(ours(folder, "flock-0"))))
    with pytest.raises(zenoh.ZError):
        stranger(endpoint, folder, (folder, "flock-1"), REFUSED_MS)


def test_agents_with_their_certificates_receive_one_another_in_a_run(tmp_path):
    ca, out = tmp_path / "ca", tmp_path / "run"
    begin_authority(ca, WallClock())
    issue(ca, [certificate_request(name, ("127.0.0.1",)) for name in ("tracker", *FLOCK)], 1, WallClock())
    proof = {"ca": ca / "ca.pem", "certificate": ca / "tracker.pem", "key": ca / "tracker.key"}
    gateways = Gateways({"": "epuck2"}, network=Network(("tls/127.0.0.1:0",), **proof))
    bare = Recording(tables=False, rrd=False)
    simulation = Simulation(SCENARIO, gateways=gateways, realtime=2.0, overrides=SHORT, out=out, record=bare)
    with simulation:
        for name in FLOCK:  # where the settings that the run wrote look for them
            for ending in ("pem", "key"):
                copy(ca / f"{name}.{ending}", out / "robots")
        with DrivenRobots(simulation, None, broken=False):
            simulation.run()
    radio = simulation.result.radio
    assert radio.fates["received"] > 10, radio
