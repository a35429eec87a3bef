"""One schedule, played."""

from pathlib import Path

from tests.tools.soak.schedules.campaigns import play_campaign
from tests.tools.soak.schedules.joined import play_joined
from tests.tools.soak.schedules.killed_world import play_killed_world
from tests.tools.soak.schedules.own_runners import play_own_runners
from tests.tools.soak.schedules.plan import Plan

PLAYS = {"own runners": play_own_runners, "world killed": play_killed_world, "campaign": play_campaign}


def play(plan: Plan, folder: Path) -> list[str]:
    """What held of a schedule, a line each; Broken if an invariant did not. Its files are left in the folder."""
    return PLAYS.get(plan.family, play_joined)(plan, folder)
