"""TOML that is read as far as it can be."""

import pytest

from swarmwire.comms.base.errors import BadInput
from swarmwire.comms.base.partial_toml import fragments, merge, read_fragments, table_in


def merged(text: str) -> dict[str, object]:
    table = dict[str, object]()
    for fragment in fragments(text):
        merge(table, fragment)
    return table


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x = 1\n[a]\ny = 2", {"x": 1, "a": {"y": 2}}),
        ('x = 1\ny = "ha\nz = 2', {"x": 1, "z": 2}),
        ("x = [1,\n  2,\n]\ny = ", {"x": [1, 2]}),
        ("x = [1,\n[a]\ny = 2", {"a": {"y": 2}}),
        ("[a\nx = 1\n[b]\nx = 2", {"a": {"x": 1}, "b": {"x": 2}}),
        ("[a]\nx = 1\n[a.b\nx = 2", {"a": {"x": 1, "b": {"x": 2}}}),
        ('[a."b c"] x = 1\ny = 2', {"a": {"b c": {"y": 2}}}),
        ("[a]\nx = 1\n[!\nx = 2", {"a": {"x": 1}}),  # values below an unknown header belong to nobody
        ("[a]\nx = 1\n[ab.]\nx = 2", {"a": {"x": 1}}),
        ("[a]\nx = 1\n[a]\nx = 2", {"a": {"x": 1}}),
        ("x = 1\nx = 2", {"x": 1}),
        ("", {}),
        ("=", {}),
    ],
)
def test_partial_toml_leaves_out_the_broken_lines_alone(text, expected):
    assert merged(text) == expected


def test_partial_toml_of_other_bytes_keeps_the_lines_that_are_text(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbfx = 1\ny = \xff\n")
    assert {"x": 1} in list(read_fragments(tmp_path / "a.toml"))
    with pytest.raises(BadInput):
        read_fragments(tmp_path / "b.toml")


def test_table_in_takes_anything_else_for_an_empty_table():
    assert table_in({"a": {"x": 1}}, "a") == {"x": 1}
    assert table_in({"a": [1]}, "a") == table_in({}, "a") == {}
