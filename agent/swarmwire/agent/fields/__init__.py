"""Fields: what pulls and pushes a robot as vectors that add up, and the way from their sum to a command.

Small functions of arrays, for `VectorAgent`s of your own: nothing is kept in them, and no row sees another.
"""

from swarmwire.agent.fields.neighbours import alignment, attraction, mean_heard, repulsion, spacing
from swarmwire.agent.fields.rays import repulsion_of_ranges, repulsion_of_rays
from swarmwire.agent.fields.smoothing import hysteresis, low_pass
from swarmwire.agent.fields.steering import steered
from swarmwire.agent.fields.vectors import Vectors, ahead, along

__all__ = [
    "Vectors",
    "ahead",
    "alignment",
    "along",
    "attraction",
    "hysteresis",
    "low_pass",
    "mean_heard",
    "repulsion",
    "repulsion_of_ranges",
    "repulsion_of_rays",
    "spacing",
    "steered",
]
