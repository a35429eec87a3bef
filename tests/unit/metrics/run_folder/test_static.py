import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from swarmwire.comms.bodies.body import body_names, load_body
from swarmwire.comms.errors import BadInput
from swarmwire.comms.geometry.floor import Floor, Patch, packed_image
from swarmwire.comms.truth import Group, Light, Obstacle, Static
from swarmwire.metrics.run_folder.tables import read_static, write_static
from tests.support.metrics.truths import static

NUMBER = st.floats(allow_nan=False, allow_infinity=False)
PAIR = st.tuples(NUMBER, NUMBER)
OBSTACLE = st.builds(
    Obstacle,
    st.sampled_from(["cylinder", "box", "polygon"]),
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
    PAIR,
    st.lists(PAIR, max_size=4).map(tuple),
    st.floats(0.0, allow_nan=False),
)
GREY = npst.arrays(np.uint8, npst.array_shapes(min_dims=2, max_dims=2, max_side=4))
PATCH = st.builds(
    Patch, st.sampled_from(["disc", "polygon"]), NUMBER, NUMBER, NUMBER, NUMBER, st.lists(PAIR, max_size=4).map(tuple)
)
FLOOR = st.builds(Floor, NUMBER, st.lists(PATCH, max_size=3).map(tuple), st.none() | GREY.map(packed_image))
LIGHT = st.builds(Light, NUMBER, NUMBER, NUMBER)


def each(item, arenas):
    return st.tuples(*[st.lists(item, max_size=3).map(tuple)] * arenas)


@st.composite
def statics(draw):
    arenas, sizes = draw(st.integers(1, 3)), draw(st.lists(st.integers(1, 4), min_size=1, max_size=3))
    groups, names = [], []
    for number, size in enumerate(sizes):
        body, start = load_body(draw(st.sampled_from(body_names()))), len(names)
        groups.append(Group(f"g{number}", body, start, start + size, draw(st.integers(1, 9))))
        names += [f"g{number}-{index}" for index in range(size)]
    return Static(
        name=draw(st.text()),
        seeds=tuple(draw(st.lists(st.integers(0), min_size=arenas, max_size=arenas, unique=True))),
        rate_hz=draw(st.integers(1, 1000)),
        arena_size_m=draw(PAIR),
        boundary=draw(st.sampled_from(["walls", "open", "torus"])),
        obstacles=draw(each(OBSTACLE, arenas)),
        groups=tuple(groups),
        robot_names=tuple(names),
        range_m=draw(st.none() | NUMBER),
        lights=draw(each(LIGHT, arenas)),
        floor=draw(st.none() | FLOOR),
    )


@given(statics())
@settings(max_examples=40, deadline=None)
def test_what_was_written_is_read_back_equal(tmp_path_factory, of):
    path = tmp_path_factory.mktemp("run") / "static.json"
    write_static(of, path)
    assert read_static(path) == of
    assert [file.name for file in path.parent.iterdir()] == ["static.json"]


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"wheels": 3}, "wheels"),
        ({"groups": [{"name": "a"}]}, "body"),
        ({"obstacles": None}, ""),
        ({"obstacles": []}, "obstacles"),
        ({"rate_hz": ["g-0"]}, "int"),
        ({"rate_hz": 0}, "rate"),
        ({"robot_names": [["g-0"]]}, "str"),
        ({"robot_names": ["g-0"]}, "groups"),
        ({"range_m": True}, "True"),
    ],
)
def test_what_is_no_static_is_refused(tmp_path, change, fault):
    path = tmp_path / "static.json"
    write_static(static(2), path)
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(BadInput, check=lambda error: error.where == str(path) and fault in error.expected):
        read_static(path)


@pytest.mark.parametrize("text", [None, "", "[1]", "{", "\x00"])
def test_what_is_no_json_object_of_ours_or_not_there_is_refused(tmp_path, text):
    path = tmp_path / "static.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(BadInput, check=lambda error: error.where == str(path)):
        read_static(path)
