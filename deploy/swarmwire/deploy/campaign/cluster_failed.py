"""A cluster that cannot go on with a campaign."""

from swarmwire.comms.errors import SwarmwireError


class ClusterFailed(SwarmwireError):
    """A cluster is out of reach, has gone away, has no workers, or its workers cannot work."""
