"""The rigs that every test of drivers is run on, by name, and how properties are tried on one of them."""

from hypothesis import HealthCheck, Phase, settings

from tests.support.robots.epuck2.epuck2_rig import Epuck2Rig, StreamingEpuck2Rig
from tests.support.robots.rig import Rig
from tests.support.robots.ros2.ros2_rig import RmwRig, Ros2Rig, StampedRmwRig

RIGS: dict[str, type[Rig]] = {
    "epuck2": Epuck2Rig,
    "epuck2 that streams": StreamingEpuck2Rig,
    "ros2 behind a bridge": Ros2Rig,
    "ros2 by rmw_zenoh": RmwRig,
    "ros2 by rmw_zenoh, stamped": StampedRmwRig,
}
ON_ONE_RIG = settings(
    max_examples=60,
    phases=[Phase.explicit, Phase.generate],  # a reading that does not come is waited for: to shrink it takes minutes
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
