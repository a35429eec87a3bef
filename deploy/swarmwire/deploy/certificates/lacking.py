"""Who of a fleet lacks a certificate that is good, and for its address."""

from datetime import datetime

from swarmwire.comms.errors import BadInput
from swarmwire.comms.wire.access_control import TRACKER
from swarmwire.deploy.certificates.register import Register
from swarmwire.deploy.certificates.wanted import Wanted, wanted
from swarmwire.deploy.fleet.fleet import Fleet


def lacking(fleet: Fleet, register: Register, now: datetime) -> list[Wanted]:
    """The robots that need a certificate, at the address where others call them, and tracker and operator if they do.

    BadInput for a robot whose name is revoked.
    """
    members = [wanted(robot.name, [robot.network_host]) for robot in fleet.robots]
    members += [Wanted(TRACKER, TRACKER), Wanted(fleet.operator, "operator")]
    return [of for of in members if _lacks(of, fleet, register, now)]


def _lacks(of: Wanted, fleet: Fleet, register: Register, now: datetime) -> bool:
    last = register.last(of.name)
    if last is None:
        return True
    if last.revoked is not None:
        raise BadInput(str(fleet.file), of.name, "is revoked for good: expected another name for this robot")
    return last.ends_soon(now) or not set(of.hosts) <= set(last.hosts)
