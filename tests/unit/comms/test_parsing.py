"""Texts of users are read, or are a ValueError: nothing else of Python's readers gets through."""

import tomllib

import pytest

from swarmwire.comms.parsing import from_json, from_toml


def test_what_is_sound_is_read() -> None:
    assert from_json('{"a": [1, 2.5]}') == from_toml("a = [1, 2.5]")


@pytest.mark.parametrize("text", ["", "{", "[" * 100_000, "1" * 5000, b"\xff"], ids=lambda text: str(text[:9]))
def test_what_is_no_json_is_a_value_error(text: str | bytes) -> None:
    with pytest.raises(ValueError):
        from_json(text)


@pytest.mark.parametrize("value", ["", "[" * 100_000, "1" * 5000, "2026-02-31"], ids=lambda text: text[:9])
def test_what_is_no_toml_is_told_as_such(value: str) -> None:
    with pytest.raises(tomllib.TOMLDecodeError):
        from_toml(f"a = {value}")
