"""What crosses a seam, from the list that is kept beside the tests."""

from reference.markdown import code, sentence, table
from tests.stable.kept import place_of
from tests.stable.sources import part_of, said_of


def seam_table(part: str) -> str:
    """Every public name of a part: what it is, and who relies on it."""
    rows: list[tuple[str, str, str, str]] = []
    for line in place_of("seams").read_text(encoding="utf-8").splitlines():
        path, _, users = line.partition(": ")
        module, name = path.split(" ")
        if part_of(module) == part:
            rows.append((code(module.removeprefix("swarmwire.")), code(name), sentence(said_of((module, name))), users))
    return table(("module", "name", "what", "used by"), rows)
