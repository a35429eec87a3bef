"""The page shows all that a report holds, needs nothing else, and takes texts for texts."""

import pytest

from swarmwire.metrics.pictures.report.page import (
    COLUMN_IN,
    Figure,
    Listing,
    Report,
    ReportTable,
    Section,
    blank_figure,
    page,
    svg_of,
    write_report,
)
from tests.support.metrics.report import Page, check_alone
from tests.support.refusals import refused_input

pytest.importorskip("matplotlib", reason="needs the extra [report]")


def drawn():
    figure = blank_figure(COLUMN_IN, 1.0)
    axes = figure.add_axes((0.1, 0.2, 0.8, 0.7))
    axes.plot([1, 2, 3], [1, 3, 2], "o-")
    axes.fill_between([1, 2], [1, 2])
    return svg_of(figure)


def report(*parts, title="A report", about=""):
    return Page(page(Report(title, (Section("Part", parts), Section("Another", ("Words.",))), about)))


def test_everything_stands_in_the_page_once():
    shown = report(
        "A text with `code` in it.",
        Listing("swarmwire sweep"),
        ReportTable(("a", "b"), (("x", "> 1"),), "An open table"),
        ReportTable(("c", "d"), (("y", "2"),), "A folded table", folded=True),
        Figure("first", drawn(), "The first figure"),
        Figure("second", drawn(), "The second figure"),
        about="In one line",
    )
    for text in ("A report", "In one line", "swarmwire sweep", "An open table", "A folded table", "The first figure"):
        assert text in shown.texts, text
    assert shown.tables == [[["a", "b"], ["x", "> 1"]], [["c", "d"], ["y", "2"]]]
    counts = {tag: shown.tags.count(tag) for tag in ("h1", "h2", "figure", "img", "details", "pre", "code", "nav")}
    assert counts == {"h1": 1, "h2": 2, "figure": 2, "img": 2, "details": 1, "pre": 1, "code": 1, "nav": 1}
    check_alone(shown)


def test_contents_of_a_page_lead_to_each_section():
    assert report("Words.").fetched == ["#part-1", "#part-2"]


def test_texts_are_no_markup():
    evil = '<script>alert("1")</script> & `<b>`'
    shown = report(
        evil,
        Listing(evil),
        ReportTable((evil, "b"), ((evil, "1"),), evil),
        Figure("a", drawn(), evil),
        title=evil,
        about=evil,
    )
    assert "script" not in shown.tags
    assert "b" not in shown.tags
    assert shown.texts.count(evil) >= 3
    assert shown.tables[0][0][0] == evil


def test_figures_that_share_a_name_are_refused():
    with pytest.raises(ValueError, match="'a'"):
        report(Figure("a", drawn(), ""), "Words.", Figure("a", drawn(), ""))


def test_columns_of_numbers_stand_at_the_right():
    rows = (("x", "1.5", "> 12 s", "−3"), ("2 y", "–", "4 %", "1,000"))
    text = report(ReportTable(("a", "b", "c", "d"), rows, "")).text
    assert text.count('<th scope="col" class="number">') == 3
    assert text.count('<td class="number">') == 6


def test_table_without_column_names_has_no_head():
    shown = report(ReportTable(("", ""), (("a", "b"),), ""))
    assert "thead" not in shown.tags
    assert shown.tables == [[["a", "b"]]]


def test_figures_are_images_whose_alternative_text_is_their_caption():
    shown = report(Figure("a", drawn(), "The share of `flock-0`"), Figure("b", drawn(), "Another"))
    assert shown.images == [drawn(), drawn()]
    assert shown.alternatives == ["The share of flock-0", "Another"]


def test_svg_is_equal_for_equal_figures_and_has_neither_date_nor_fonts():
    text = drawn().decode()
    assert text == drawn().decode()
    for unwanted in ("<metadata", "dc:date", "font-family"):
        assert unwanted not in text, unwanted


def test_rounded_coordinates_leave_the_scale_of_letters():
    assert 'transform="scale(0.015625)"' in drawn().decode()


@pytest.fixture
def foreign(tmp_path):
    """A run folder of somebody else's, and a folder of the user's with a file."""
    mine, folder = tmp_path / "mine", tmp_path / "foreign"
    mine.mkdir()
    folder.mkdir()
    (mine / "first.svg").write_text("mine")
    return folder, mine


def test_links_to_files_of_the_user_are_replaced_by_a_report(foreign):
    folder, mine = foreign
    (folder / "figures").mkdir()
    places = [folder / ".aside-report.html", folder / "figures" / ".aside-first.svg", folder / "figures" / "first.svg"]
    for link in places:
        link.symlink_to(mine / "first.svg")
    content = Report("Foreign", (Section("Part", (Figure("first", drawn(), "A figure"),)),))
    written = write_report(content, folder / "report.html")
    assert [file.name for file in mine.iterdir()] == ["first.svg"]
    assert (mine / "first.svg").read_text() == "mine"
    assert not any(path.is_symlink() for path in written)
    assert b"<svg" in written[1].read_bytes()


def test_linked_folder_of_figures_is_refused_by_a_report(foreign):
    folder, mine = foreign
    (folder / "figures").symlink_to(mine)
    content = Report("Foreign", (Section("Part", (Figure("first", drawn(), "A figure"),)),))
    with refused_input(folder / "figures"):
        write_report(content, folder / "report.html")
    assert (mine / "first.svg").read_text() == "mine"
