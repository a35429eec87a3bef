"""All distributions, built, and environments with some of them: each made once in a run of tests."""

from pathlib import Path

import pytest

from tests.release.built import Installed, build, install, made_once, shared_folder


@pytest.fixture(scope="session")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once(shared_folder(tmp_path_factory), "distributions", build)


@pytest.fixture
def everything(distributions: Path, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path) -> Installed:
    """What `pip install swarmwire` brings."""
    wheels = distributions.glob("*.whl")
    folder = made_once(shared_folder(tmp_path_factory), "everything", lambda at: install(at, wheels))
    return Installed(folder, tmp_path)


@pytest.fixture
def robot(distributions: Path, tmp_path_factory: pytest.TempPathFactory, tmp_path: Path) -> Installed:
    """What `pip install swarmwire-agent` brings."""
    wheels = [next(distributions.glob(f"swarmwire_{part}-*.whl")) for part in ("agent", "comms")]
    folder = made_once(shared_folder(tmp_path_factory), "robot", lambda at: install(at, wheels))
    return Installed(folder, tmp_path)
