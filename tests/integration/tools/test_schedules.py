"""A few random schedules of faults, of each kind that is cheap. `python -m tests.tools.soak.schedules` plays hundreds."""

import pytest

from tests.tools.soak.schedules.plan import Fault, draw
from tests.tools.soak.schedules.play import play

COUNT = 200  # that are played where the docs tell of them


@pytest.mark.parametrize(("seed", "family"), [(8, "wait"), (59, "goes on"), (12, "real time"), (9, "own runners")])
def test_what_must_hold_does_whatever_happens(seed, family, tmp_path):
    plan = draw(seed)
    assert plan.family == family
    assert plan.faults
    assert all(play(plan, tmp_path))


def test_a_seed_draws_one_schedule_and_all_kinds_of_faults_are_drawn():
    plans = [draw(seed) for seed in range(1, COUNT + 1)]
    assert plans == [draw(seed) for seed in range(1, COUNT + 1)]
    assert {plan.family for plan in plans} == {
        "wait", "goes on", "real time", "own runners", "world killed", "campaign"
    }  # fmt: skip
    assert {plan.on_loss for plan in plans} == {"stop", "dead", "wait", "stand", "coast"}
    faults: list[Fault] = [fault for plan in plans for fault in plan.faults]
    assert {fault.what for fault in faults} == {"killed", "frozen", "frozen too long", "slowed", "leaves"}
    assert {fault.who.rstrip("0123456789") for fault in faults} == {"r", "observer", "router"}
    assert any(plan.late for plan in plans)
    assert any(plan.router for plan in plans)
