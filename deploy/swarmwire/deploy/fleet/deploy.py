"""`swarmwire robots deploy`: packages and a release to each robot, tried out there before it becomes the current."""

import asyncio
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from swarmwire.deploy.fleet.archive import Archive, Entry
from swarmwire.deploy.fleet.fleet import Fleet, Robot
from swarmwire.deploy.fleet.host_session import HostSession, on_hosts
from swarmwire.deploy.fleet.packages import Environments, Target
from swarmwire.deploy.fleet.release import ROBOT_PROGRAM, package_links, write_release
from swarmwire.deploy.fleet.result import SILENT, HostFailed, Result, Watcher

TRIAL_S = 60.0  # an old Pi takes seconds to import its packages for the first time
ROOM = 1.5  # free bytes that are asked for, over those that are to come
SPARE_BYTES = 20_000_000  # that stay free for logs


async def deploy(
    fleet: Fleet,
    robots: Sequence[Robot],
    contents: dict[str, list[Entry]],
    environments: Environments,
    watcher: Watcher = SILENT,
    *,
    restart: bool = False,
) -> list[Result]:
    """What became of each robot; `contents` are the releases' entries by robot."""
    with tempfile.TemporaryDirectory() as folder:
        deployment = _Deployment(contents, environments, Path(folder), watcher, restart)
        return await on_hosts(robots, fleet.known_hosts, deployment.one, deployment.before, deployment.after, watcher)


@dataclass
class _Deployment:
    """One deployment: what goes where."""

    contents: dict[str, list[Entry]]
    environments: Environments
    folder: Path
    watcher: Watcher
    restart: bool
    making: asyncio.Lock = field(default_factory=asyncio.Lock)  # packages of a platform are made once

    async def before(self, session: HostSession, robots: list[Robot]) -> None:
        """Lock the host, and clear away what interrupted deployments left there."""
        session.need_manager()
        await session.ask("lock")
        await session.ask("clear_parts", robots=[robot.name for robot in robots])

    async def one(self, session: HostSession, robot: Robot) -> Result:
        """Bring one robot to its release."""
        archives = await self._packages(session, robot)
        python = session.facts["executable"]
        release = await asyncio.to_thread(
            write_release, self.contents[robot.name], robot, python, archives, self.folder
        )
        there = await session.ask("present", robots=[robot.name])
        mine = there["robots"][robot.name]
        whole = {archive.name for archive in archives} <= set(there["environments"])
        if mine["current"] == release.name and mine["unit"] and whole:
            return Result(
                robot.name, True, f"up to date: {release.name}" + await self._started(session, robot, release)
            )
        missing = [archive for archive in archives if archive.name not in there["environments"]]
        _check_room(session, [*missing, release])
        for archive in missing:
            await self._send(session, robot, archive, "put_environment", "packages", name=archive.name)
        if release.name not in mine["releases"]:
            await self._send(session, robot, release, "put_release", "release", robot=robot.name, name=release.name)
            self.watcher.step(robot.name, "trial run")
            command = [*ROBOT_PROGRAM, "check", "--config", "robot.toml"]
            links = list(package_links(archives))
            await session.ask(
                "try_out", robot=robot.name, release=release.name, packages=links, command=command, timeout_s=TRIAL_S
            )
        self.watcher.step(robot.name, "switch")
        await session.ask("switch", robot=robot.name, release=release.name)
        packages = f" and {sum(archive.size for archive in missing) / 1e6:.1f} MB of packages" if missing else ""
        return Result(
            robot.name, True, f"deployed {release.name}{packages}" + await self._started(session, robot, release)
        )

    async def after(self, session: HostSession, robots: list[Robot]) -> None:
        """Remove what is old."""
        await session.ask("tidy", robots=[robot.name for robot in robots])

    async def _packages(self, session: HostSession, robot: Robot) -> list[Archive]:
        target = Target.of(session.facts)
        self.watcher.step(robot.name, "packages")
        async with self.making:
            return await asyncio.to_thread(
                self.environments.archives, target, [robot.settings["driver"]["name"]], robot.packages
            )

    async def _send(
        self, session: HostSession, of: Robot, archive: Archive, do: str, what: str, **request: str
    ) -> None:
        def told(sent: int) -> None:
            self.watcher.step(of.name, what, sent, archive.size)

        told(0)
        await session.send(do, archive, told, **request)

    async def _started(self, session: HostSession, robot: Robot, release: Archive) -> str:
        """Restart a robot that runs another release, if that was asked for; what there is to say of it."""
        state = (await session.ask("state", robots=[robot.name]))[robot.name]
        running = state.get("running", "")
        if state.get("ActiveState") not in ("active", "activating") or running == release.name:
            return ""
        if not self.restart:
            return f"; still runs {running or 'another'}, until it is started anew"
        self.watcher.step(robot.name, "restart")
        said = (await session.ask("run_units", verb="restart", robots=[robot.name]))[robot.name]
        if said:
            raise HostFailed(
                f"deployed {release.name}, which does not start: {said}", "swarmwire robots logs, rollback"
            )
        return ", restarted"


def _check_room(session: HostSession, coming: Sequence[Archive]) -> None:
    free = session.facts["free_bytes"]
    needed = round(ROOM * sum(archive.unpacked for archive in coming)) + SPARE_BYTES
    if free < needed:
        raise HostFailed(
            f"the disk is full: {free / 1e6:.0f} MB are free, {needed / 1e6:.0f} MB are needed",
            "make room: df -h; old logs lie in ~/swarmwire/*/log",
        )
