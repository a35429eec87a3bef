"""What a run shows to observers elsewhere: its scene, and a glimpse of each tick."""

from typing import Any

import numpy as np

from swarmwire.comms.glimpse import Glimpse, Scene, Series
from swarmwire.comms.wire.frames import decode
from swarmwire.comms.wire.scene_frames import decode_scene, encode_scene
from swarmwire.comms.wire.truth_frames import decode_truth, encode_truth
from tests.tools.fuzz.miniature import Miniature, begun
from tests.tools.fuzz.target import FrameTarget
from tests.unit.comms.wire.test_truth_frames import SCENE


class Scenes(FrameTarget):
    """Scenes."""

    name = "scene"
    inner = ("values",)

    def make_samples(self) -> list[bytes]:
        """The miniature's, one with obstacles and a floor, and one of each type's own samples."""
        return [encode_scene(_scene(begun())), encode_scene(SCENE)]

    def door(self, case: bytes) -> None:
        """The decoder."""
        decode_scene(decode(case))


class Glimpses(FrameTarget):
    """Truth, tick by tick."""

    name = "truth"

    def make_samples(self) -> list[bytes]:
        """Real ticks."""
        of = begun()
        self.scene = _scene(of)
        return [
            encode_truth(Glimpse(truth, at, len(of.truths), np.array([[0.5]])))
            for at, truth in enumerate(of.truths)
            if at > len(of.truths) - 4
        ]

    def door(self, case: bytes) -> Any:
        """The decoder, for this scene."""
        glimpse = decode_truth(decode(case), self.scene)
        encode_truth(glimpse)


def _scene(of: Miniature) -> Scene:
    static = of.world.static
    return Scene(static, (Series("order", "", (0.0, 1.0)),), static.robot_names[0])
