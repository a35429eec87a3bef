"""Draws docs/epuck2-camera.png: what the camera of an emulated e-puck2 shows, four times as large."""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from swarmwire.world.gateways.epuck2.camera import HEIGHT, WIDTH, picture
from swarmwire.world.scenario_file import scenario_from
from swarmwire.world.world import World

TO = Path(__file__).parents[1] / "epuck2-camera.png"
ZOOM = 4
SCENARIO: dict[str, Any] = {
    "format": 1,
    "name": "camera",
    "duration_s": 1.0,
    "arena": {
        "size_m": [2.0, 1.5],
        "obstacles": [
            {"shape": "cylinder", "radius_m": 0.06, "height_m": 0.2, "at": [0.55, 0.22]},
            {"shape": "box", "size_m": [0.3, 0.08], "height_m": 0.02, "at": [0.1, -0.12]},
            {"shape": "box", "size_m": [0.15, 0.15], "height_m": 0.3, "at": [0.7, -0.3], "heading_rad": 0.4},
        ],
        "lights": [{"intensity": 2.0, "at": [0.8, 0.07]}],
        "ground": {"patches": [{"shape": "disc", "radius_m": 0.12, "at": [0.0, 0.08], "shade": 0.0}]},
    },
    "robots": {
        "swarm": {
            "body": "epuck2",
            "count": 4,
            "agent": "swarmwire.agent.behaviours:Avoidance",
            "place": {"how": "poses", "poses": [[-0.4, 0, 0], [-0.1, 0.1, 2.6], [0.2, 0, -2], [0.5, -0.15, 3.1]]},
        }
    },
}
# By robot and LED: some of the ring, front LED and body LED.
LIT = {1: {0: 0xFF0000, 1: 0x00FF00, 7: 0xFF00FF}, 2: {9: 0x00FF00}, 3: {1: 0x00FFFF, 8: 0xFF0000}}


def draw(to: Path = TO) -> None:
    """Write the picture that the first robot's camera shows."""
    scene = World(scenario_from(SCENARIO, "camera"), [1], {"swarm": []}).scene
    for robot, leds in LIT.items():
        for led, rgb in leds.items():
            scene.leds[0, robot, led] = rgb
    pixels = np.frombuffer(picture(scene, 0), ">u2").reshape(HEIGHT, WIDTH)
    rgb = np.stack([(pixels >> 11 & 31) * 255 // 31, (pixels >> 5 & 63) * 255 // 63, (pixels & 31) * 255 // 31], -1)
    image = Image.fromarray(rgb.astype(np.uint8))
    image.resize((ZOOM * WIDTH, ZOOM * HEIGHT), Image.Resampling.NEAREST).save(to, optimize=True)


if __name__ == "__main__":
    draw()
