"""What the six wheels and source distributions hold, and what they say of themselves."""

import base64
import csv
import hashlib
import re
import tarfile
import tomllib
import zipfile
from pathlib import Path, PurePosixPath

import pytest
from packaging.metadata import Metadata

from tests.release.built import PARTS, ROOT

VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
NAMES = ("swarmwire", *(f"swarmwire_{part}" for part in PARTS))
MADE = {"__pycache__"}  # beside sources, by Python and numba


def sources(name: str) -> set[str]:
    """The files of a part, as they lie in its folder."""
    if name == "swarmwire":
        return set()
    folder = ROOT / name.removeprefix("swarmwire_")
    paths = (path for path in (folder / "swarmwire").rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix() for path in paths if not MADE & set(path.parts)}


def wheel(distributions: Path, name: str) -> zipfile.ZipFile:
    return zipfile.ZipFile(distributions / f"{name}-{VERSION}-py3-none-any.whl")


def beside(name: str) -> str:
    return f"{name}-{VERSION}.dist-info"


def test_there_are_a_wheel_and_a_source_distribution_of_each(distributions: Path) -> None:
    files = {path.name for path in distributions.iterdir() if path.suffix in {".whl", ".gz"}}
    assert files == {f"{name}-{VERSION}{end}" for name in NAMES for end in ("-py3-none-any.whl", ".tar.gz")}


@pytest.mark.parametrize("name", NAMES)
def test_wheel_holds_sources_data_and_licence_of_its_part_only(distributions: Path, name: str) -> None:
    with wheel(distributions, name) as file:
        held = set(file.namelist())
        licence = file.read(f"{beside(name)}/licenses/LICENSE")
    about = {path for path in held if path.startswith(beside(name))}
    assert held - about == sources(name)
    scripts = {f"{beside(name)}/entry_points.txt"}
    files = {f"{beside(name)}/{file}" for file in ("METADATA", "WHEEL", "RECORD", "licenses/LICENSE")}
    assert files <= about <= files | scripts
    assert licence == (ROOT / "LICENSE").read_bytes()


@pytest.mark.parametrize("name", NAMES)
def test_wheel_files_have_the_digests_of_its_record(distributions: Path, name: str) -> None:
    with wheel(distributions, name) as file:
        rows = list(csv.reader(file.read(f"{beside(name)}/RECORD").decode().splitlines()))
        assert {row[0] for row in rows} == set(file.namelist())
        for path, digest, _ in rows:
            sha256 = base64.urlsafe_b64encode(hashlib.sha256(file.read(path)).digest()).decode().rstrip("=")
            assert digest == f"sha256={sha256}" or path.endswith("RECORD")


@pytest.mark.parametrize("name", NAMES)
def test_wheel_metadata_is_valid_and_complete(distributions: Path, name: str) -> None:
    """As an index checks it, and what its page would be empty without."""
    with wheel(distributions, name) as file:
        metadata = Metadata.from_email(file.read(f"{beside(name)}/METADATA"), validate=True)
    assert (metadata.name, str(metadata.version)) == (name.replace("_", "-"), VERSION)
    assert (str(metadata.license_expression), metadata.license_files) == ("Apache-2.0", ["LICENSE"])
    assert str(metadata.requires_python) == ">=3.11"
    assert metadata.summary
    assert metadata.description_content_type == "text/markdown"
    assert metadata.description
    assert metadata.description.lstrip().startswith(f"# {metadata.name}\n")
    links = re.findall(r"\]\(([^)]*)\)", metadata.description)
    assert all(link.startswith("https://") for link in links), "a page of the index has no files beside it"
    assert metadata.author
    kinds = {classifier.partition(" :: ")[0] for classifier in metadata.classifiers or []}
    assert {"Intended Audience", "Operating System", "Programming Language", "Typing"} <= kinds
    assert "License" not in kinds  # PEP 639: license_expression alone
    ours = [requirement for requirement in metadata.requires_dist or [] if requirement.name.startswith("swarmwire")]
    assert {str(requirement.specifier) for requirement in ours} <= {f"=={VERSION}"}


@pytest.mark.parametrize("name", NAMES)
def test_source_distribution_holds_sources_without_tests_docs_scenarios(distributions: Path, name: str) -> None:
    with tarfile.open(distributions / f"{name}-{VERSION}.tar.gz") as file:
        held = {PurePosixPath(path).relative_to(f"{name}-{VERSION}").as_posix() for path in file.getnames()}
    others = {"PKG-INFO", "pyproject.toml", "README.md", "LICENSE", ".gitignore"}
    assert held - others == (sources(name) or {"CHANGELOG.md"})
    assert others - held <= {".gitignore"}
