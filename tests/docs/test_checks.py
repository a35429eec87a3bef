"""The checks of the pages find what does not fit; whether the pages fit now is what `make docs-check` says."""

from pathlib import Path

import pytest

from docs import checks, prose_checks, protocol_checks
from docs.reference import filled
from swarmwire.comms.base.errors import BadInput


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only page that there is."""
    (tmp_path / "docs").mkdir()
    monkeypatch.setattr(checks, "ROOT", tmp_path)
    monkeypatch.setattr(checks, "PAGES", ["docs/page.md"])
    monkeypatch.setattr("tests.docs.pages.ROOT", tmp_path)
    return tmp_path / "docs" / "page.md"


def test_link_to_a_missing_page_is_a_problem(page: Path):
    page.write_text("[here](page.md), [elsewhere](https://example.org), [a part](page.md#part)")
    assert list(checks.links()) == []
    page.write_text("[gone](gone.md)")
    assert len(list(checks.links())) == 1


LISTED = "```{toctree}\n:caption: Pages\n\npage\n```\n"


@pytest.mark.parametrize(("index", "problems"), [(LISTED, 0), (LISTED * 2, 1), ("page", 1)])
def test_page_listed_twice_or_never_is_a_problem(page: Path, index: str, problems: int):
    page.with_name("index.md").write_text(index)
    assert len(list(checks.contents())) == problems


def test_generated_table_out_of_date_is_a_problem(page: Path):
    page.write_text("<!-- reference: fates -->\n<!-- /reference -->\n")
    assert len(list(checks.generated_tables())) == 1
    page.write_text(filled(page.read_text(), "docs/page.md"))
    assert "- `received`: " in page.read_text()
    assert list(checks.generated_tables()) == []
    page.write_text("<!-- reference: no-such-table -->\n<!-- /reference -->\n")
    with pytest.raises(BadInput, match="expected one of"):
        list(checks.generated_tables())


@pytest.mark.parametrize(
    "text",
    ["```toml\na = \n```\n", "```python\n1\n```\n", "<!-- file: a.py -->\n```python\n1\n```\nNobody runs `a.py`.\n"],
)
def test_code_that_is_broken_or_unused_is_a_problem(page: Path, text: str):
    page.write_text(text)
    assert len(list(checks.code_blocks())) == 1


def test_protocol_table_without_a_row_is_a_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    before = list(protocol_checks.protocol_page())
    text = protocol_checks.PAGE.read_text(encoding="utf-8")
    before_it, title, table = text.partition("<!-- table: limits -->\n")
    head, rule, _row, *rows = table.splitlines(keepends=True)
    (tmp_path / "protocol.md").write_text("".join([before_it, title, head, rule, *rows]))
    monkeypatch.setattr(protocol_checks, "PAGE", tmp_path / "protocol.md")
    assert len(list(protocol_checks.protocol_page())) > len(before)


def test_problems_are_printed_one_a_line_with_exit_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    for expected, code in (((), 0), (("a page: a problem",), 1)):
        monkeypatch.setattr(checks, "CHECKS", (lambda problems=expected: iter(problems),))
        assert checks.main() == code
        assert capsys.readouterr().out.splitlines()[:-1] == list(expected)


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ("Nobody\ntells whom.\n", 3),
        ("A run that goes\non.\n", 1),
        ("The frame goes on air.\n", 0),
        ("`told` is [a name](whatever.md).\n\n```text\nwhoever\n```\n", 0),
    ],
)
def test_refused_word_on_a_page_is_a_problem(page: Path, monkeypatch: pytest.MonkeyPatch, text: str, problems: int):
    monkeypatch.setattr(prose_checks, "ROOT", page.parents[1])
    monkeypatch.setattr(prose_checks, "PAGES", ["docs/page.md"])
    page.write_text(text)
    refusals = list(prose_checks.prose())
    assert len(refusals) == problems
    assert all(problem.startswith("docs/page.md:") and ": expected " in problem for problem in refusals)


def test_public_docstrings_and_messages_are_prose_and_private_ones_are_not():
    source = 'def public():\n    "One"\n\n\ndef _private():\n    "Two"\n    return "key", "a message"\n'
    assert sorted(prose_checks.texts_of(source)) == [(2, "One"), (7, "a message")]
