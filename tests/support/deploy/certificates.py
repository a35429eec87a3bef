"""A CA in a folder on a day that tests choose, its certificates, and peers that have them."""

import json
import queue
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
import zenoh
from cryptography import x509

from swarmwire.comms.base.clock import NS_PER_S
from swarmwire.comms.wire.keys import SwarmKeys
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.robot_network import endpoints_of
from swarmwire.deploy.robots.certificates.folder import begin_authority, issue
from swarmwire.deploy.robots.certificates.register import DAY, Issued, certificate_request
from tests.support.clocks import FakeClock

TODAY = "2026-06-01T12:00:00Z"
KEYS = SwarmKeys("lab")
ROBOTS = ("flock-0", "flock-1", "flock_2")
LISTEN = ("tls/127.0.0.1:0",)
WITHIN_S = 20.0
REFUSED_MS, PATIENT_MS = 300, 20_000  # a stranger tries so long


class DatedFakeClock(FakeClock):
    """A clock that shows a date until it is told to show another."""

    def __init__(self, date: str) -> None:
        super().__init__()
        self.date = datetime.fromisoformat(date)

    def utc_ns(self) -> int:
        return round(self.date.timestamp()) * NS_PER_S

    def pass_days(self, days: int) -> None:
        self.date += days * DAY


def issued(folder: Path, clock: DatedFakeClock, *names: str, days: int = 365, renew: bool = False) -> list[Issued]:
    return issue(folder, [certificate_request(name) for name in names], days, clock, renew=renew)


def certificate(folder: Path, name: str) -> x509.Certificate:
    return x509.load_pem_x509_certificate((folder / f"{name}.pem").read_bytes())


@pytest.fixture
def clock() -> DatedFakeClock:
    return DatedFakeClock(TODAY)


@pytest.fixture
def folder(tmp_path: Path, clock: DatedFakeClock) -> Path:
    path = tmp_path / "lab" / "ca"
    begin_authority(path, clock)
    return path


def network_of(folder: Path, name: str, *others: zenoh.Session, revoked: tuple[str, ...] = ()) -> Network:
    """The settings of a peer that listens at a port of the system's choice and calls all others."""
    certificate, key = folder / f"{name}.pem", folder / f"{name}.key"
    calls = tuple(map(endpoint_of, others))
    return Network(LISTEN, calls, ca=folder / "ca.pem", certificate=certificate, key=key, revoked=revoked)


def stranger(endpoint: str, authority: Path, certificate: tuple[Path, str] | None, patience_ms: int) -> zenoh.Session:
    """A session that calls one endpoint; zenoh.ZError if it is not let in."""
    connects = {"connect": {"endpoints": [endpoint], "timeout_ms": patience_ms, "exit_on_failure": True}}
    tls: dict[str, object] = {"root_ca_certificate": str(authority / "ca.pem")}
    if certificate:
        folder, name = certificate
        client = {
            "connect_certificate": str(folder / f"{name}.pem"),
            "connect_private_key": str(folder / f"{name}.key"),
        }
        tls |= client | {"enable_mtls": True}
    config = {"mode": "client", "scouting": {"multicast": {"enabled": False}}, "transport": {"link": {"tls": tls}}}
    return zenoh.open(zenoh.Config.from_json5(json.dumps(config | connects)))


def endpoint_of(session: zenoh.Session) -> str:
    """Return the endpoint of a peer."""
    return endpoints_of(session, Network(LISTEN))[0]


def wait_for_listeners(session: zenoh.Session, key: str) -> None:
    """Return once somebody is known who hears what the session puts on that key."""
    publisher = session.declare_publisher(key)
    _wait_for_match(publisher)
    publisher.undeclare()


def replies_of(session: zenoh.Session, key: str, *, wait: bool) -> list[str]:
    """All replies to a query, which waits until somebody is known who answers, or does not."""
    querier = session.declare_querier(key, timeout=WITHIN_S)
    if wait:
        _wait_for_match(querier)
    return [reply.ok.payload.to_string() for reply in querier.get() if reply.ok]


def _wait_for_match(declared: zenoh.Publisher | zenoh.Querier) -> None:
    matches: queue.SimpleQueue[bool] = queue.SimpleQueue()
    declared.declare_matching_listener(lambda status: matches.put(status.matching))
    if not declared.matching_status.matching:
        assert matches.get(timeout=WITHIN_S)


def at_once(callback: Callable[[Any], None]) -> "zenoh.handlers.Callback[Any]":
    """A callback that zenoh's own thread calls, so all that comes by one link is told in the order in which it came.

    Otherwise each declaration has a thread of its own, and what two of them tell may change places.
    """
    return zenoh.handlers.Callback(callback, indirect=False)


class Inbox:
    """Keys of what a session hears, in the order of each link."""

    def __init__(self, session: zenoh.Session, *keys: str) -> None:
        self._received: queue.SimpleQueue[str] = queue.SimpleQueue()
        for key in keys:
            session.declare_subscriber(key, at_once(lambda sample: self._received.put(str(sample.key_expr))))

    def next(self) -> str:
        return self._received.get(timeout=WITHIN_S)

    def empty(self) -> bool:
        return self._received.empty()


class Links:
    """Waits for links of a session to come and go."""

    def __init__(self, session: zenoh.Session) -> None:
        self._events: queue.SimpleQueue[bool] = queue.SimpleQueue()
        session.info.declare_transport_events_listener(
            lambda event: self._events.put(event.kind == zenoh.SampleKind.PUT), history=True
        )

    def wait(self, *, up: bool) -> None:
        while self._events.get(timeout=WITHIN_S) != up:
            pass
