"""Formats of motion traces: BonnMotion, ns-2, EMANE and tables."""

from dataclasses import replace
from math import inf, nan
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarmwire.comms.base.errors import BadInput
from swarmwire.world.motion.traces.reading import read_trace, write_trace
from swarmwire.world.motion.traces.trace import MotionTrace, TracePoses, trace_of_columns
from tests.support.refusals import refused_input
from tests.support.world.traces import traces

ORIGIN = (55.0, 5.0, 200.0)
HEADER = "t_s,robot,x_m,y_m\n"


def read(folder: Path, name: str, text: str, origin: tuple[float, float, float] | None = None) -> MotionTrace:
    (folder / name).write_text(text)
    return read_trace(folder / name, origin=origin)


def positions(trace: MotionTrace, time_s: float) -> list[list[float]]:
    return TracePoses(trace, range(len(trace.names)), 0.0).at(time_s)[:, :3].tolist()


def equal(a: MotionTrace, b: MotionTrace) -> bool:
    columns = "first", "t_s", "x_m", "y_m", "z_m", "heading_rad"
    same = [np.array_equal(getattr(a, column), getattr(b, column), equal_nan=True) for column in columns]
    return a.names == b.names and all(same)


# Two nodes of BonnMotion's Printer.java: way points as "time x y", one line a node.
def test_bonnmotion_in_two_dimensions_is_time_x_y_repeated(tmp_path: Path) -> None:
    trace = read(tmp_path, "a.movements", "# made by hand\n0.0 10.0 20.0 4.0 30.0 20.0\n\n0.0 1.5 2.5\n")
    assert trace.names == ("0", "1")
    assert trace.first.tolist() == [0, 2, 3]
    assert positions(trace, 1.0) == [[15.0, 20.0, 0.0], [1.5, 2.5, 0.0]]
    assert np.isnan(trace.heading_rad).all()


NUMBERS = "0 1 2 3 4 5 6 7 8 9 10 11\n"  # four way points in two dimensions, or three in three


@pytest.mark.parametrize(
    ("text", "parameters", "expected"),
    [
        (NUMBERS, None, [7.0, 8.0, 0.0]),
        (NUMBERS, "model=RandomWaypoint\nJ=2D\n", [7.0, 8.0, 0.0]),
        (NUMBERS, "model=RandomWaypoint\nJ=3D\n", [7.0, 8.0, 9.0]),
        (f"#3D\n{NUMBERS}", None, [7.0, 8.0, 9.0]),
        ("0 1 2 3 6 7 8 9\n", None, [7.0, 8.0, 9.0]),
    ],
)
def test_bonnmotion_dimensions_are_those_that_the_file_states(
    tmp_path: Path, text: str, parameters: str | None, expected: list[float]
) -> None:
    if parameters:
        (tmp_path / "a.params").write_text(parameters)
    assert positions(read(tmp_path, "a.movements", text), 6.0) == [expected]


NS2_SQUARE = """
# nodes 7 and 2
$node_(7) set Y_ 2.0   # X_ is 0
set opt(nn) 2
$god_ set-dist 2 7 1
$ns_ at 1.0 "$node_(2) setdest 6 8 5"
$ns_ at 9.0 "$node_(2) set Z_ 1.5  "
$ns_ at 4.0 "$node_(2) setdest 6 0 2";
$ns_ at 2.0 "$node_(7) set X_ 4.0"
"""


@pytest.mark.parametrize(
    ("time_s", "expected"),
    [
        (0.5, [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]),
        (2.0, [[3.0, 4.0, 0.0], [4.0, 2.0, 0.0]]),  # 10 m at 5 m/s
        (3.5, [[6.0, 8.0, 0.0], [4.0, 2.0, 0.0]]),
        (5.0, [[6.0, 6.0, 0.0], [4.0, 2.0, 0.0]]),
        (8.5, [[6.0, 0.0, 0.0], [4.0, 2.0, 0.0]]),
        (9.5, [[6.0, 0.0, 1.5], [4.0, 2.0, 0.0]]),
    ],
)
def test_ns2_statements_move_their_nodes(tmp_path: Path, time_s: float, expected: list[list[float]]) -> None:
    trace = read(tmp_path, "a.tcl", NS2_SQUARE)
    assert trace.names == ("2", "7")
    assert positions(trace, time_s) == expected


# Positions at which ns-3 reports a change of course: src/mobility/test/ns2-mobility-helper-test-suite.cc.
NS3 = {
    "interrupted (bug 1219)": (
        [(1, "setdest 0 10 1"), (6, "setdest 0 -10 1")],
        (0, 0),
        [(1, 0, 0), (6, 0, 5), (21, 0, -10)],  # 15 m at 1 m/s; the reference point of the test lies after its end
    ),
    "long (bug 1316)": (
        [
            *((50, "setdest 400 50 1"), (150, "setdest 400 150 4"), (300, "setdest 250 150 3")),
            *((350, "setdest 250 50 1"), (600, "setdest 250 1050 2"), (900, "setdest 300 650 2.5")),
        ],
        (350, 50),
        [
            *((50, 350, 50), (100, 400, 50), (150, 400, 50), (175, 400, 150), (300, 400, 150), (350, 250, 150)),
            *((450, 250, 50), (600, 250, 50), (900, 250, 650), (920, 300, 650)),
        ],
    ),
    "speed of zero": ([(1, "setdest 25 0 5"), (7, "setdest 11 22 0")], (0, 0), [(6, 25, 0), (7, 25, 0), (9, 25, 0)]),
    "where it is (bug 1301)": ([(1, "setdest 10 0 1")], (10, 0), [(0, 10, 0), (1, 10, 0), (20, 10, 0)]),
}


@pytest.mark.parametrize("case", NS3)
def test_ns2_positions_are_those_of_ns3(tmp_path: Path, case: str) -> None:
    events, (x, y), expected = NS3[case]
    text = f"$node_(0) set X_ {x}\n$node_(0) set Y_ {y}\n"
    text += "".join(f'$ns_ at {t_s} "$node_(0) {statement}"\n' for t_s, statement in events)
    trace = read(tmp_path, "a.ns_movements", text)
    for t_s, x_m, y_m in expected:
        assert positions(trace, t_s) == [pytest.approx([x_m, y_m, 0.0], abs=1e-9)]


def test_ns2_height_changes_during_a_motion_and_a_set_position_ends_it(tmp_path: Path) -> None:
    start = '$ns_ at 0 "$node_(0) setdest 10 0 1"\n'
    raised = read(tmp_path, "a.tcl", start + '$ns_ at 4 "$node_(0) set Z_ 3"\n')
    assert [positions(raised, t_s)[0] for t_s in (3.0, 5.0, 11.0)] == [[3, 0, 0], [5, 0, 3], [10, 0, 3]]
    put = read(tmp_path, "a.tcl", start + '$ns_ at 4 "$node_(0) set Y_ 3"\n')
    assert [positions(put, t_s)[0] for t_s in (3.0, 5.0, 11.0)] == [[3, 0, 0], [4, 3, 0], [4, 3, 0]]


def test_ns2_destination_of_three_coordinates_is_reached_in_space(tmp_path: Path) -> None:
    trace = read(tmp_path, "a.tcl", '$ns_ at 1 "$node_(0) setdest 2 3 6 3.5"\n')  # 7 m
    assert [positions(trace, t_s)[0] for t_s in (2.0, 3.0)] == [[1, 1.5, 3], [2, 3, 6]]


# The example of EPSG method 9837 in Guidance Note 7-2, with the degrees of PROJ's page on "topocentric".
EEL = """
0.0 nem:3 pathloss nem:1,90.0 nem:2,90.0
-Inf  nem:12 location gps 53.80939444,2.12955,73.0
0.0 nem:3 location gps 55.0,5.0,200.0,msl   # the origin
10.0 nem:3 velocity 90.0,0.0,10.0
10.0 nem:3 location gps 55.0,5.0,230.0
"""


def test_emane_location_is_east_north_and_up_of_the_origin(tmp_path: Path) -> None:
    trace = read(tmp_path, "a.eel", EEL, ORIGIN)
    assert trace.names == ("3", "12")
    origin, far = positions(trace, 5.0)
    assert origin == pytest.approx([0.0, 0.0, 15.0], abs=1e-6)
    assert far == pytest.approx([-189013.869, -128642.040, -4220.171], abs=2e-3)


def test_emane_degrees_at_the_equator_have_the_ellipsoids_lengths(tmp_path: Path) -> None:
    # Radii of curvature there: a = 6378137 m along the equator, a (1 - e2) = 6335439.327 m along the meridian.
    text = "0 nem:1 location gps 0.0,0.00001,0.0\n0 nem:2 location gps 0.00001,0.0,0.0\n"
    east, north = positions(read(tmp_path, "a.eel", text, (0.0, 0.0, 0.0)), 0.0)
    assert east == pytest.approx([6378137.0 * np.deg2rad(1e-5), 0.0, 0.0], abs=1e-6)
    assert north == pytest.approx([0.0, 6335439.327 * np.deg2rad(1e-5), 0.0], abs=1e-6)


def test_table_takes_columns_in_any_order_and_ignores_others(tmp_path: Path) -> None:
    text = "note,robot, y_m,x_m,t_s,heading_rad\nx,b,1,2,0,\nx,a,3,4,0,0.5\nx,b, 5,6,2,\n"
    trace = read(tmp_path, "a.csv", text)
    assert trace.names == ("b", "a")
    assert positions(trace, 1.0) == [[4.0, 3.0, 0.0], [4.0, 3.0, 0.0]]
    np.testing.assert_array_equal(trace.heading_rad, [nan, nan, 0.5])


def test_table_in_parquet_is_read_with_numbered_robots(tmp_path: Path) -> None:
    columns = {"t_s": [0, 0, 1, 1], "robot": [10, 2, 10, 2], "x_m": [0.0, 1.0, 2.0, 3.0], "y_m": [0.0] * 4}
    pl.DataFrame(columns).with_columns(pl.col("x_m").cast(pl.Float32), z_m=4.0).write_parquet(tmp_path / "a.parquet")
    trace = read_trace(tmp_path / "a.parquet")
    assert trace.names == ("10", "2")
    assert positions(trace, 0.5) == [[1.0, 0.0, 4.0], [2.0, 0.0, 4.0]]


def test_table_may_be_sorted_by_time_or_robot_and_lack_what_is_zero(tmp_path: Path) -> None:
    t_s, robot = np.repeat(np.arange(5), 3), np.tile(["c", "a", "b"], 5)
    x_m, y_m = np.sin(np.arange(15.0)), np.cos(np.arange(15.0))
    by_time = pl.DataFrame({"t_s": t_s, "robot": robot, "x_m": x_m, "y_m": y_m})
    by_robot = by_time[[*range(0, 15, 3), *range(1, 15, 3), *range(2, 15, 3)]]
    in_part = by_time[[*range(6), *range(6, 15, 3), *range(7, 15, 3), *range(8, 15, 3)]]
    frames = by_time, by_robot, in_part, by_time.with_columns(z_m=0.0, heading_rad=None)
    for number, frame in enumerate(frames):
        frame.write_parquet(tmp_path / f"{number}.parquet")
    first, *others = [read_trace(tmp_path / f"{number}.parquet") for number in range(len(frames))]
    assert (first.names, first.first.tolist()) == (("c", "a", "b"), [0, 5, 10, 15])
    assert first.x_m.tolist() == by_robot["x_m"].to_list()
    assert all(equal(trace, first) for trace in others)


@pytest.mark.parametrize("suffix", [".movements", ".movements.gz", ".csv", ".parquet"])
@given(trace=traces())
def test_round_trip_keeps_every_sample(tmp_path_factory: pytest.TempPathFactory, suffix: str, trace: MotionTrace):
    path = tmp_path_factory.mktemp("trace") / f"a{suffix}"
    write_trace(path, trace)
    names = trace.names if suffix in (".csv", ".parquet") else tuple(map(str, range(len(trace.names))))
    again = read_trace(path)
    assert again.names == names
    assert equal(replace(again, names=trace.names), trace)


def test_round_trip_of_a_table_keeps_headings(tmp_path: Path) -> None:
    trace = trace_of_columns(
        ("a", "b"), np.array([0, 1, 3]), *(np.arange(3) / 7.0 for _ in range(4)), np.array([0.1, nan, -3.0])
    )
    for suffix in (".csv", ".parquet"):
        write_trace(tmp_path / f"a{suffix}", trace)
        assert equal(read_trace(tmp_path / f"a{suffix}"), trace)


@pytest.mark.parametrize("suffix", [".tcl", ".eel"])
@given(trace=traces())
def test_round_trip_keeps_every_position(tmp_path_factory: pytest.TempPathFactory, suffix: str, trace: MotionTrace):
    path = tmp_path_factory.mktemp("trace") / f"a{suffix}"
    if suffix == ".tcl":
        columns = trace.t_s, trace.x_m, trace.y_m, np.full(len(trace.t_s), 2.5), trace.heading_rad
        trace = trace_of_columns(trace.names, trace.first, *columns)
    write_trace(path, trace, origin=ORIGIN)
    again = read_trace(path, origin=ORIGIN)
    assert again.names == trace.names
    before, after = (TracePoses(one, range(len(trace.names)), 0.0) for one in (trace, again))
    for time_s in (np.arange(620) / 20.0 + 1e-3).tolist():
        assert np.abs(before.at(time_s)[:, :3] - after.at(time_s)[:, :3]).max() < 1e-6


FAULTS = [
    ("a.xyz", "", "", "ends in .movements"),
    ("a.movements", "", "", "at least one robot"),
    ("a.tcl", "# nothing\n", "", "at least one robot"),
    ("a.eel", "0.0 nem:1 pathloss nem:2,90\n", "", "at least one robot"),
    ("a.csv", "", "", "at least one robot"),
    ("a.csv", HEADER, "", "at least one robot"),
    ("a.movements", "0 1 2\n0 1 x\n", "line 2", "a number, got 'x'"),
    ("a.movements", "0 1 nan\n", "line 1", "got 'nan'"),
    ("a.movements", "0 1 inf\n", "line 1", "got 'inf'"),
    ("a.movements", "#3D\n0 1 2\n", "line 2", "t x y z repeated"),
    ("a.movements", "0 1 2 3 4\n", "line 1", "t x y repeated"),
    ("a.movements", "# c\n2 1 2 1 1 2\n", "line 2", "rising times, got 1 s after 2 s"),
    ("a.tcl", '\n$ns_ at x "$node_(0) setdest 1 2 3"\n', "line 2", "got 'x'"),
    ("a.tcl", '$ns_ at "$node_(0) setdest 1 2 3"\n', "line 1", "expected "),
    ("a.tcl", '$ns_ at 1 "$node_(0) setdest 1 2"\n', "line 1", "X Y SPEED"),
    ("a.tcl", '$ns_ at 1 "$node_(0) setdest 1 2 -3"\n', "line 1", "speed of at least 0"),
    ("a.tcl", '$ns_ at -1 "$node_(0) setdest 1 2 3"\n', "line 1", "at least 0 s"),
    ("a.tcl", '$ns_ at 1 "$node_(0) setdest 1 2 1e-320"\n', "line 1", "arrives"),
    ("a.tcl", "$node_($i) set X_ 1\n", "line 1", "number of a node"),
    ("a.tcl", "$node_(0) set X_ 1e999\n", "line 1", "got '1e999'"),
    ("a.eel", "0 nem:a location gps 1,2,3\n", "line 1", "nem: and a number"),
    ("a.eel", "0 nem:1 location gps 1,2\n", "line 1", "LATITUDE,LONGITUDE,ALTITUDE"),
    ("a.eel", "0 nem:1 location gps 91,2,3\n", "line 1", "-90 to 90"),
    ("a.eel", "1 nem:1 location gps 1,2,3\n0 nem:1 location gps 1,2,3\n", "line 2", "rising times"),
    ("a.csv", "t_s,robot,x_m\n0,a,1\n", "y_m", "is missing; the table has t_s, robot, x_m"),
    ("a.csv", f"{HEADER}0,a,1,2\n1,a,1,b\n", "line 3, y_m", "got 'b'"),
    ("a.csv", f"{HEADER}0,a,1,2\n1,a,1,\n", "line 3, y_m", "expected a number"),
    ("a.csv", f"{HEADER}0,a,nan,2\n", "line 2, x_m", "got 'nan'"),
    ("a.csv", f"{HEADER}0,,1,2\n", "line 2, robot", "name of a robot"),
    ("a.csv", f"{HEADER}5,a,1,2\n0,b,1,2\n6,b,1,2\n4,a,1,2\n", "line 5, t_s", "rising times"),
    ("a.csv", "t_s,robot,x_m,y_m,heading_rad\n0,a,1,2,\n1,a,1,2,north\n", "line 3, heading_rad", "got 'north'"),
    ("a.csv", f"{HEADER}0,a,1,2,3,4,5\n", "", "intact table"),
    ("a.parquet", "PAR1", "", "intact table"),
    ("a.movements.gz", "0 1 2\n", "", "readable file"),
]


@pytest.mark.parametrize(("name", "text", "key", "match"), FAULTS)
def test_faults_of_a_file_are_refused_with_their_line(tmp_path: Path, name: str, text: str, key: str, match: str):
    with refused_input(tmp_path / name, key, match):
        read(tmp_path, name, text, ORIGIN)


TEXTS = {
    "a.movements": "#3D\n0.0 10.0 20.0 0.0 4.0 30.0 20.0 5.0\n0.0 1.5 2.5 0.0\n",
    "a.tcl": NS2_SQUARE,
    "a.eel": EEL,
    "a.csv": "t_s,robot,x_m,y_m,z_m,heading_rad\n0,a,1,2,3,\n1,a,1,2,3,0.5\n0,b,1,2,3,-0.5\n",
}
CHARACTERS = st.text("0123456789.-+e \n\t\"'$#:,;()_XYZabinfst", max_size=6)


@pytest.mark.parametrize("name", TEXTS)
@given(at=st.floats(0.0, 1.0), removed=st.integers(0, 8), inserted=CHARACTERS)
def test_damaged_file_is_refused_or_gives_finite_poses(
    tmp_path_factory: pytest.TempPathFactory, name: str, at: float, removed: int, inserted: str
) -> None:
    start = int(at * len(TEXTS[name]))
    text = TEXTS[name][:start] + inserted + TEXTS[name][start + removed :]
    try:
        trace = read(tmp_path_factory.mktemp("trace"), name, text, ORIGIN)
    except BadInput:
        return
    followed = TracePoses(trace, range(len(trace.names)), 0.0)
    assert all(np.isfinite(followed.at(time_s)).all() for time_s in (0.0, 0.5, 3.0, 1e6))


def test_infinite_time_in_parquet_is_refused_with_its_row(tmp_path: Path) -> None:
    frame = pl.DataFrame({"t_s": [0.0, inf], "robot": ["a", "a"], "x_m": [0.0, 1.0], "y_m": [0.0, 1.0]})
    frame.write_parquet(tmp_path / "a.parquet")
    with refused_input(tmp_path / "a.parquet", "row 2, t_s", "got inf"):
        read_trace(tmp_path / "a.parquet")


@pytest.mark.parametrize("name", ["a.movements", "a.movements.gz", "a.tcl", "a.eel", "a.csv", "a.parquet"])
def test_file_that_is_missing_or_no_text_is_refused(tmp_path: Path, name: str) -> None:
    with refused_input(tmp_path / name, "", "readable file"):
        read_trace(tmp_path / name, origin=ORIGIN)
    (tmp_path / name).write_bytes(b"\xff\xfe\x00\x80")
    with refused_input(tmp_path / name):
        read_trace(tmp_path / name, origin=ORIGIN)


def test_emane_file_without_an_origin_is_refused(tmp_path: Path) -> None:
    with refused_input(tmp_path / "a.eel", match="origin: latitude and longitude"):
        read(tmp_path, "a.eel", EEL)
