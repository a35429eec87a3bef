"""What each fault does, as `faults/` tells it: a file a process of a run, in it a row for each fault.

    title = "A runner"                    the heading of its table in docs/reliability.md

    [[fault]]
    fault = "killed, `on_runner_loss = \\"stop\\"`"
    sees = "…"                            what the user sees
    kept = "…"                            what is kept of the run
    goes_on = "…"                         how it goes on

    [[fault.proof]]
    test = "tests/deploy/test_x.py::test_y"
    file = "world/swarmwire/world/x.py"   what handles it: a file of the five parts,
    code = "…"                            text that stands in it once,
    without = "…"                         and what stands there when the handling is taken away: the test then fails

`python -m tests.tools.reliability` writes the page, `python -m tests.tools.reliability.without` tries the proofs.
"""

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[3]
FAULTS = Path(__file__).parent / "faults"
ORDER = (  # of the tables on the page
    "world", "runner", "observer", "page", "router", "dask-worker", "ssh-connection", "robot", "machine",
)  # fmt: skip


@dataclass(frozen=True)
class Proof:
    """A test of a row, and the handling without which it fails."""

    test: str
    file: str
    code: str
    without: str

    def source(self) -> str:
        """The file as it is, in which `code` stands once."""
        text = (ROOT / self.file).read_text(encoding="utf-8")
        found = text.count(self.code)
        assert found == 1, f"{self.test}: its code stands {found} times in {self.file}, not once: {self.code!r}"
        return text

    def changed(self) -> str:
        """The file without the handling."""
        return self.source().replace(self.code, self.without)


@dataclass(frozen=True)
class Fault:
    """A row: what was done to a process and when, what comes of it, and the proofs of that."""

    fault: str
    sees: str
    kept: str
    goes_on: str
    proof: tuple[Proof, ...]


@dataclass(frozen=True)
class Process:
    """The rows about a kind of process."""

    name: str
    title: str
    faults: tuple[Fault, ...]


def processes() -> list[Process]:
    """All that `faults/` holds, in the order of the page."""
    files = sorted(FAULTS.glob("*.toml"), key=lambda file: ORDER.index(file.stem))
    return [_process(file) for file in files]


def proofs() -> list[Proof]:
    """Those of all rows, each once."""
    return list(dict.fromkeys(its for process in processes() for fault in process.faults for its in fault.proof))


def _process(file: Path) -> Process:
    table = tomllib.loads(file.read_text(encoding="utf-8"))
    assert set(table) == {"title", "fault"}, f"{file.name} has a title and faults, not {sorted(table)}"
    return Process(file.stem, table["title"], tuple(_fault(file, row) for row in table["fault"]))


def _fault(file: Path, row: dict[str, Any]) -> Fault:
    _check_keys(file, row, Fault)
    for proof in row["proof"]:
        _check_keys(file, proof, Proof)
    return Fault(**row | {"proof": tuple(Proof(**proof) for proof in row["proof"])})


def _check_keys(file: Path, row: dict[str, Any], kind: type[Fault | Proof]) -> None:
    wanted = {field.name for field in fields(kind)}
    assert set(row) == wanted, f"{file.name}: a row has {sorted(wanted)}, not {sorted(row)}: {row}"
