"""All targets, by name."""

from tests.fuzz.target import Target
from tests.fuzz.targets.runner_frames import RunnerFrames
from tests.fuzz.targets.world_frames import WorldFrames

ALL: tuple[type[Target], ...] = (WorldFrames, RunnerFrames)
TARGETS = {target.name: target for target in ALL}
