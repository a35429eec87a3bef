"""Atomic writes: whole or not at all, and never through a link that somebody left in the folder."""

import stat
from pathlib import Path

import pytest

from swarmwire.comms.base.atomic import atomic_write, make_subfolder, output_file, write_bytes, write_text
from tests.support.refusals import refused_input


@pytest.fixture
def treasure(tmp_path):
    """A file of the user's, outside the folder that is written into."""
    file = tmp_path / "treasure"
    file.write_text("mine")
    (tmp_path / "foreign").mkdir()
    return file


@pytest.mark.parametrize("link", [".aside-page.html", "page.html"])
@pytest.mark.parametrize("link_to", [Path.symlink_to, Path.hardlink_to])
def test_write_replaces_a_link_and_leaves_its_target(tmp_path, treasure, link, link_to):
    page = tmp_path / "foreign" / "page.html"
    link_to(page.with_name(link), treasure)
    write_text(page, "report")
    assert (treasure.read_text(), page.read_text()) == ("mine", "report")
    assert not page.is_symlink()
    assert [file.name for file in page.parent.iterdir()] == ["page.html"]


def test_write_that_fails_leaves_the_former_file_alone(tmp_path):
    page = tmp_path / "page.html"
    page.write_text("former")

    def interrupted():
        with atomic_write(page) as aside:
            aside.write_text("half")
            raise InterruptedError

    with pytest.raises(InterruptedError):
        interrupted()
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("page.html", "former")]


def test_private_file_has_its_mode_before_its_content(tmp_path):
    with atomic_write(tmp_path / "a.key", mode=0o600) as aside:
        assert stat.S_IMODE(aside.stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "a.key").stat().st_mode) == 0o600


def test_write_without_replacing_refuses_a_file_or_a_link(tmp_path, treasure):
    link = tmp_path / "foreign" / "a.key"
    link.symlink_to(treasure)
    for path in (treasure, link):
        with pytest.raises(FileExistsError):
            write_bytes(path, b"key", replace=False)
    assert treasure.read_text() == "mine"
    assert not list(tmp_path.glob("**/.aside-*"))


def test_folder_in_the_way_of_an_output_file_is_one_line(tmp_path):
    (tmp_path / ".aside-page.html").mkdir()
    with refused_input(tmp_path / "page.html"), output_file(tmp_path / "page.html"):
        pass


def test_subfolder_that_is_a_link_is_refused(tmp_path, treasure):
    (tmp_path / "figures").symlink_to(treasure.parent / "foreign")
    with pytest.raises(OSError, match="link") as refused:
        make_subfolder(tmp_path / "figures")
    assert refused.value.filename == str(tmp_path / "figures")
    make_subfolder(tmp_path / "new")
    make_subfolder(tmp_path / "new")
    assert (tmp_path / "new").is_dir()
