"""The picture of a runner's states in the docs is drawn from the table of moves."""

from docs.pictures import runner_states


def test_the_picture_in_the_docs_shows_the_table_of_moves(tmp_path) -> None:
    runner_states.draw(tmp_path / "again.svg")
    drawn = (tmp_path / "again.svg").read_bytes()
    assert drawn == runner_states.TO.read_bytes(), "python -m docs.pictures.runner_states"
