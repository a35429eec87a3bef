"""Whether a robot hears the others of its swarm, and is seen by the tracker: told once when it is not, and when it is.

A wrong endpoint, a firewall or a camera that is off look like a quiet swarm: only time tells.
"""

import ssl
from collections.abc import Callable, Collection, Sequence

from swarmwire.comms.clock import NS_PER_S, Clock, to_ns
from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.network import Network
from swarmwire.comms.wire.radio_bridge import Pose

TIMEOUT_S = 5.0


class LivenessWatch:
    """Looks when it is told to; without a radio or a tracker there is nothing to be missed."""

    def __init__(
        self,
        clock: Clock,
        say: Callable[[str], None],
        others: Sequence[str] = (),
        received: Callable[[], Collection[str]] = tuple,
        pose: Callable[[], Pose | None] | None = None,
        pace: float = 1.0,
    ) -> None:
        """`others` are to be received, and `received` tells which ever were.

        `pose` is the robot's newest, with a tracker.
        """
        self._clock, self._say, self._received, self._pose = clock, say, received, pose
        self._patience_ns = to_ns(TIMEOUT_S * pace)
        self._silent, self._others = list(others), others
        self._began_ns = self._looked_ns = self._seen_ns = clock.now_ns()
        self._told_silent = self._told_unseen = False
        self._without_pose_ns = 0

    def look(self) -> None:
        """Tell what is missing for too long, and what has come since that was told."""
        now_ns = self._clock.now_ns()
        self._listen(now_ns)
        if self._pose is not None:
            self._watch(now_ns, self._pose() is not None)
        self._looked_ns = now_ns

    def counts(self) -> dict[str, int]:
        """For how many seconds no pose came, by name."""
        return {"seconds_without_pose": self._without_pose_ns // NS_PER_S}

    def _listen(self, now_ns: int) -> None:
        if not self._silent:
            return
        received = set(self._received())
        came = [robot for robot in self._silent if robot in received]
        self._silent = [robot for robot in self._silent if robot not in received]
        if self._told_silent and came:
            self._say(f"radio: now hears {', '.join(came)}")
        if self._silent and not self._told_silent and now_ns - self._began_ns >= self._patience_ns:
            self._told_silent = True
            how = "hears none of" if len(self._silent) == len(self._others) else "has never received"
            self._say(f"radio: {how} {', '.join(self._silent)}")

    def _watch(self, now_ns: int, seen: bool) -> None:
        if seen:
            self._seen_ns = now_ns
            if self._told_unseen:
                self._told_unseen = False
                self._say("tracker: poses come")
            return
        self._without_pose_ns += now_ns - self._looked_ns
        if not self._told_unseen and now_ns - self._seen_ns >= self._patience_ns:
            self._told_unseen = True
            self._say(f"tracker: no pose of this robot has come for {TIMEOUT_S:g} s")


# --- Whether the certificate that a robot shows others goes with its key and its authority, before anything is opened.
#
# The network would only fail to link, in silence, for ever.


NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID: a robot without a battery for its clock learns the date later


def check_certificates(network: Network, where: str) -> None:
    """BadInput at `network.certificate`, `network.key` or `network.ca` in `where`, if they do not go together."""
    certificate, key, ca = network.certificate, network.key, network.ca
    if certificate is None or key is None or ca is None:
        return
    shows = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        shows.load_cert_chain(certificate, key, password="")  # or it would ask for one at the terminal
    except (ssl.SSLError, ValueError) as error:
        text = f"expected the key of {certificate}: {key} is none, or of another certificate ({_reason(error)})"
        raise BadInput(where, "network.key", text) from None
    asks = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    asks.check_hostname = False
    try:
        asks.load_verify_locations(ca)
    except ssl.SSLError as error:
        raise BadInput(where, "network.ca", f"expected a certificate: {ca} is none ({_reason(error)})") from None
    fault = _fault(shows, asks)
    if fault:
        raise BadInput(where, "network.certificate", f"expected one that {ca} signed: {certificate}: {fault}")


def _fault(shows: ssl.SSLContext, asks: ssl.SSLContext) -> str | None:
    """Why whoever asks would not take what the other shows; both ends talk in memory."""
    to_asker, to_shower = ssl.MemoryBIO(), ssl.MemoryBIO()
    asker = asks.wrap_bio(to_asker, to_shower)
    shower = shows.wrap_bio(to_shower, to_asker, server_side=True)
    for end in (asker, shower, asker):
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
    """What OpenSSL says, in a few words."""
    reason = getattr(error, "reason", None) or str(error)
    return str(reason).replace("_", " ").lower()
