"""All targets, by name."""

from tests.fuzz.target import Target
from tests.fuzz.targets.air import AirSent, Heard, Terms
from tests.fuzz.targets.control import Control, Page, Replies
from tests.fuzz.targets.join import Given, Join, Offered
from tests.fuzz.targets.observed import Glimpses, Scenes
from tests.fuzz.targets.radio import Poses, Questions, Radio
from tests.fuzz.targets.runner_frames import RunnerFrames
from tests.fuzz.targets.world_frames import WorldFrames

ALL: tuple[type[Target], ...] = (
    *(WorldFrames, RunnerFrames, Join, Offered, Given),
    *(Scenes, Glimpses, Control, Replies, Page),
    *(Terms, Heard, AirSent, Radio, Poses, Questions),
)
TARGETS = {target.name: target for target in ALL}
