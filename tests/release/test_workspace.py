"""What holds for the five parts together: versions, arrows, and the laws that lint enforces."""

import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.release.bump import CITED

ROOT = Path(__file__).parents[2]
PARTS = ("comms", "agent", "world", "metrics", "deploy")
HEAVY = ("matplotlib", "numba", "pandas", "polars", "pyarrow", "pydantic", "pymunk", "rerun", "rich", "scipy", "typer")


def project(folder: str) -> dict[str, Any]:
    return tomllib.loads((ROOT / folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def requirements(table: dict[str, Any]) -> list[str]:
    extras = table.get("optional-dependencies", {})
    return [*table.get("dependencies", []), *(line for lines in extras.values() for line in lines)]


def distribution(requirement: str) -> str:
    """The name in a requirement such as `swarmwire-comms[medium]==0.1.0`."""
    return requirement.split("==", maxsplit=1)[0].split(">=", maxsplit=1)[0].split("[", maxsplit=1)[0].strip()


def run_python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=100)


def test_version_number_is_equal_in_every_part() -> None:
    versions = {folder: project(folder)["version"] for folder in (".", *PARTS)}
    versions["CITATION.cff"] = CITED.findall((ROOT / "CITATION.cff").read_text(encoding="utf-8"))[0]
    assert len(set(versions.values())) == 1, versions


@pytest.mark.parametrize("folder", [".", *PARTS])
def test_parts_pin_one_another_exactly(folder: str) -> None:
    version = project(folder)["version"]
    ours = [line for line in requirements(project(folder)) if distribution(line).startswith("swarmwire")]
    assert all(line.endswith(f"=={version}") for line in ours), ours


def test_root_distribution_depends_on_all_parts() -> None:
    dependencies = {distribution(line) for line in project(".")["dependencies"]}
    assert dependencies == {f"swarmwire-{part}" for part in PARTS}


@pytest.mark.parametrize(
    ("part", "dependencies"),
    [("comms", set()), *((part, {"swarmwire-comms"}) for part in ("agent", "world", "metrics"))],
)
def test_part_depends_on_no_other_of_ours_but_comms(part: str, dependencies: set[str]) -> None:
    assert {distribution(line) for line in requirements(project(part)) if "swarmwire" in line} == dependencies


def test_namespace_package_has_no_init_and_parts_are_marked_as_typed() -> None:
    assert not [str(path) for part in PARTS for path in (ROOT / part / "swarmwire").glob("__init__.py*")]
    assert all((ROOT / part / "swarmwire" / part / "py.typed").is_file() for part in PARTS)


def test_licence_is_apache_in_full_and_in_every_part() -> None:
    text = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text
    assert {project(folder)["license"] for folder in (".", *PARTS)} == {"Apache-2.0"}


def test_lock_file_names_the_public_index_alone() -> None:
    packages = tomllib.loads((ROOT / "uv.lock").read_text(encoding="utf-8"))["package"]
    registries = {package["source"].get("registry", "https://pypi.org/simple") for package in packages}
    assert registries == {"https://pypi.org/simple"}


def test_robot_modules_load_without_compiler_and_physics() -> None:
    """All of agent, and of comms all but the kernels, loads where the heavy libraries are not installed."""
    done = run_python(f"""
import importlib, pkgutil, sys

for heavy in {HEAVY}:
    sys.modules[heavy] = None  # importing it raises ImportError
import swarmwire.agent, swarmwire.comms

compiled = "radio base.kernels base.kernel_archive base.draws_compiled base.math.compiled base.geometry"
kernels = tuple("swarmwire.comms." + name for name in compiled.split())
for package in (swarmwire.agent, swarmwire.comms):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not module.name.startswith(kernels):
            importlib.import_module(module.name)
""")
    assert done.returncode == 0, done.stderr


def test_banned_calls_are_refused_by_ruff_in_every_part(tmp_path: Path) -> None:
    """Every part refuses every banned call; only the clock may read the time, and only tests draw from generators."""
    banned = {
        "sleep": "import time\n\ntime.sleep(1)\n",
        "rest": "from time import sleep as rest\n\nrest(1)\n",
        "time": "import time\n\nprint(time.monotonic_ns())\n",
        "counter": "from time import perf_counter\n\nprint(perf_counter())\n",
        "date": "from datetime import UTC, datetime\n\nprint(datetime.now(UTC))\n",
        "dice": "import random\n\nprint(random.random())\n",
        "draws": "import numpy as np\n\nprint(np.random.default_rng(1))\n",
        "pickles": "import pickle\n\nprint(pickle)\n",
    }
    files = {f"{part}/swarmwire/{part}/{name}.py": code for part in PARTS for name, code in banned.items()}
    files |= {f"{folder}/sleep.py": banned["sleep"] for folder in ("tests", "benchmarks")}
    allowed = {f"{folder}/draws.py": banned["draws"] for folder in ("tests", "benchmarks")}
    allowed["comms/swarmwire/comms/base/clock.py"] = banned["time"]
    for path, code in (files | allowed).items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(code)
    for folder in (".", "tests", "benchmarks"):
        for settings in (ROOT / folder).glob("*.toml"):
            shutil.copy(settings, tmp_path / folder)
    command = [sys.executable, "-m", "ruff", "check", "--no-cache", "--output-format=concise", "--select=TID251", "."]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 1, done.stderr
    assert {line.split(":")[0] for line in done.stdout.splitlines() if " TID251 " in line} == set(files)
