"""The picture of a runner's states in the docs is drawn from the table of moves."""

from docs.pictures import runner_states


def test_the_picture_in_the_docs_shows_the_table_of_moves() -> None:
    assert runner_states.TO.read_text(encoding="utf-8") == runner_states.picture()
