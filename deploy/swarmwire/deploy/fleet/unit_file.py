"""The systemd unit of a robot: runs the current release, sees that it lives, and stops the motors after it."""

from collections.abc import Sequence

from swarmwire.deploy.fleet.host_side.units import unit_of

ROBOT_PROGRAM = ("-P", "-m", "swarmwire.agent.cli")  # of Python: it needs no scripts to be installed
UNIT = """\
[Unit]
Description=swarmwire robot {robot}
StartLimitIntervalSec=60
StartLimitBurst=5

[Service]
Type=notify
NotifyAccess=all
WorkingDirectory={current}
Environment="PYTHONPATH={paths}" PYTHONUNBUFFERED=1
ExecStart="{python}" {program} run --config {current}/robot.toml
ExecStopPost="{python}" {program} stop-motors --config {current}/robot.toml
WatchdogSec=10
TimeoutStartSec=30
TimeoutStopSec=5
KillMode=mixed
Restart=on-failure
RestartSec=2
NoNewPrivileges=yes
"""


def unit_file(robot: str, python: str, packages: Sequence[str]) -> tuple[str, str]:
    """Name and content; `packages` are the links within a release to what its Python has on its path.

    It is not started with the machine: no robot moves because it was switched on.
    """
    current = f"%h/swarmwire/{robot}/current"
    # The agent, which tells systemd that it lives, is a child of its guard: hence NotifyAccess, and KillMode, with
    # which the guard alone is told to end: it passes that on.
    paths = ":".join(f"{current}/{name}" for name in packages)
    text = UNIT.format(robot=robot, current=current, paths=paths, python=python, program=" ".join(ROBOT_PROGRAM))
    return unit_of(robot), text
