"""Checks of a robot's network: missing robots and poses at run time, and the certificates before the start.

`LivenessWatch` reports robots of the swarm and tracker poses that have not been received for 5 s, once, and their
return. Nothing else distinguishes a wrong endpoint, a firewall or a camera that is off from a quiet swarm.

`check_certificates` compares a robot's certificate with its key and its authority before a connection is opened.
With a mismatch, the network would never link, and report nothing.
"""

import ssl
from collections.abc import Callable, Collection, Sequence

from swarmwire.comms.base.clock import NS_PER_S, Clock, to_ns
from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.radio_bridge import Pose

TIMEOUT_S = 5.0
NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID; a robot without a clock battery gets the date later


class LivenessWatch:
    """Watches the robot's radio and tracker; `check` is called once a second."""

    def __init__(
        self,
        clock: Clock,
        report: Callable[[str], None],
        others: Sequence[str],
        received: Callable[[], Collection[str]],
        pose: Callable[[], Pose | None] | None,
        pace: float,
    ) -> None:
        """Expect packets of `others`, of whom `received` lists the senders so far, and poses from the tracker's `pose`.

        Without a radio `others` is empty, and without a tracker `pose` is None.
        """
        self._clock, self._report, self._received, self._pose = clock, report, received, pose
        self._timeout_ns = to_ns(TIMEOUT_S * pace)
        self._silent, self._others = list(others), others
        self._started_ns = self._checked_ns = self._seen_ns = clock.now_ns()
        self._reported_silent = self._reported_unseen = False
        self._without_pose_ns = 0

    def check(self) -> None:
        """Report missing robots and poses once, and their return."""
        now_ns = self._clock.now_ns()
        self._check_radio(now_ns)
        if self._pose is not None:
            self._check_tracker(now_ns, self._pose() is not None)
        self._checked_ns = now_ns

    def counts(self) -> dict[str, int]:
        """Return the seconds without a pose, by name."""
        return {"seconds_without_pose": self._without_pose_ns // NS_PER_S}

    def _check_radio(self, now_ns: int) -> None:
        if not self._silent:
            return
        received = set(self._received())
        new = [robot for robot in self._silent if robot in received]
        self._silent = [robot for robot in self._silent if robot not in received]
        if self._reported_silent and new:
            self._report(f"radio: first packets from {', '.join(new)}")
        if self._silent and not self._reported_silent and now_ns - self._started_ns >= self._timeout_ns:
            self._reported_silent = True
            all_silent = len(self._silent) == len(self._others)
            scope = "any of " if all_silent else ""
            self._report(f"radio: no packets from {scope}{', '.join(self._silent)}")

    def _check_tracker(self, now_ns: int, seen: bool) -> None:
        if seen:
            self._seen_ns = now_ns
            if self._reported_unseen:
                self._reported_unseen = False
                self._report("tracker: receives poses again")
            return
        self._without_pose_ns += now_ns - self._checked_ns
        if not self._reported_unseen and now_ns - self._seen_ns >= self._timeout_ns:
            self._reported_unseen = True
            self._report(f"tracker: no pose of this robot for {TIMEOUT_S:g} s")


def check_certificates(network: Network, where: str) -> None:
    """Raise BadInput at `network.certificate`, `network.key` or `network.ca` in `where` if they do not match."""
    certificate, key, ca = network.certificate, network.key, network.ca
    if certificate is None or key is None or ca is None:
        return
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        server.load_cert_chain(certificate, key, password="")  # without a password OpenSSL prompts at the terminal
    except (ssl.SSLError, ValueError) as error:
        text = f"expected the key of {certificate}: {key} is none, or of another certificate ({_reason(error)})"
        raise BadInput(where, "network.key", text) from None
    client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.check_hostname = False
    try:
        client.load_verify_locations(ca)
    except ssl.SSLError as error:
        raise BadInput(where, "network.ca", f"expected a certificate: {ca} is none ({_reason(error)})") from None
    fault = _handshake_fault(server, client)
    if fault:
        raise BadInput(where, "network.certificate", f"expected one that {ca} signed: {certificate}: {fault}")


def _handshake_fault(server: ssl.SSLContext, client: ssl.SSLContext) -> str | None:
    """Do a handshake in memory; return the reason for which the client refuses the server, None if it accepts."""
    to_client, to_server = ssl.MemoryBIO(), ssl.MemoryBIO()
    client_end = client.wrap_bio(to_client, to_server)
    server_end = server.wrap_bio(to_server, to_client, server_side=True)
    for end in (client_end, server_end, client_end):
        try:
            end.do_handshake()
        except ssl.SSLWantReadError:
            continue
        except ssl.SSLCertVerificationError as error:
            return None if error.verify_code == NOT_YET_VALID else error.verify_message
        except ssl.SSLError as error:
            return _reason(error)
    return None


def _reason(error: Exception) -> str:
    """Return OpenSSL's reason, in a few words."""
    reason = getattr(error, "reason", None) or str(error)
    return str(reason).replace("_", " ").lower()
