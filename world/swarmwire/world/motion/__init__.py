"""Robots that others move: their poses come from a source, not from an engine.

    [robots.NAME.motion]      scenario/motion.py   the source of a group's poses, and its settings
    a source in lockstep      source.py            a pose for every time: traces, classes of users
    a live source             live.py              poses as they arrive: udp.py, mavlink.py, tracker.py, ros2.py
    `FollowedRobots`          followed.py          where these robots are at the end of each tick
    the engines               engines/             move them there; other robots push against them in vain

A source in lockstep belongs to the world and depends on time alone, so a run repeats bit for bit. A live source belongs
to the run: `FollowingBackend` adds its poses to the actions of each tick, which are recorded, so a run can be repeated
from its record.
"""
