"""The drawings on the page about the design: of the code as it is."""

from docs.pictures import parts, tick_figure
from docs.pictures.tick_steps import LANES, tick_steps


def test_the_parts_are_drawn_as_they_are(tmp_path):
    parts.draw(tmp_path / "parts.svg")
    assert (tmp_path / "parts.svg").read_bytes() == parts.TO.read_bytes(), "python -m docs.pictures.parts"


def test_the_tick_is_drawn_as_the_loop_has_it(tmp_path):
    tick_figure.draw(tmp_path / "tick-steps.svg")
    assert (tmp_path / "tick-steps.svg").read_bytes() == tick_figure.TO.read_bytes(), (
        "python -m docs.pictures.tick_figure"
    )


def test_all_take_part_in_a_tick_and_agents_act_on_what_world_and_air_gave():
    steps = tick_steps()
    assert {step.lane for step in steps}.issuperset(LANES)
    takes = next(step for step in steps if step.lane == "crew").takes
    assert set(takes) == {("senses", "world"), ("packets", "mailbox"), ("outcomes", "mailbox")}
