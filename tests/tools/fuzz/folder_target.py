"""Folders that a run, a campaign or a robot left, or that people wrote: one file in them cut, changed or gone."""

import json
import tomllib
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import tomli_w

from swarmwire.comms.errors import BadInput
from tests.tools.fuzz.byte_changes import changed_bytes
from tests.tools.fuzz.dice import Dice
from tests.tools.fuzz.magic import TEXTS
from tests.tools.fuzz.target import Target, changed_inside, check_file_line
from tests.tools.fuzz.tree_changes import changed_tree

CELLS = ("", "nan", "inf", "-inf", "0", "-1", "1e308", "-0.0", "1e19", "9223372036854775808", "0.5", "true", '"', "é")


class Changed(NamedTuple):
    """A file of the folder as it is found; None: it is gone."""

    name: str
    data: bytes | None
    deep: bool = False  # whether it goes on to what costs most


class FolderTarget(Target):
    """A sound folder, in which each case changes one file."""

    refusals = (BadInput,)
    inner: ClassVar[tuple[str, ...]] = ()
    deep: ClassVar[float] = 0.02  # of the cases go on to what costs most

    def make_samples(self) -> Sequence[Changed]:
        """Every file as it is."""
        self.place = self.folder / "sound"
        self.make(self.place)
        files = sorted(path for path in self.place.rglob("*") if path.is_file() and self.is_read(path))
        return [Changed(str(path.relative_to(self.place)), path.read_bytes(), not at) for at, path in enumerate(files)]

    @abstractmethod
    def make(self, folder: Path) -> None:
        """Fill the folder, which is not there yet."""

    def is_read(self, path: Path) -> bool:
        """Whether a file of it is looked into by whoever reads the folder."""
        return path.suffix in (".json", ".jsonl", ".toml", ".csv", ".parquet", ".bin", ".pem", ".txt", ".log")

    @abstractmethod
    def read(self, folder: Path, *, deep: bool) -> str | None:
        """Read the folder; BadInput names the file."""

    def case(self, dice: Dice) -> Changed:
        """One file, changed as its kind is, or gone."""
        at = dice.below(len(self.samples))
        sample: Changed = self.samples[at]
        if dice.chance(0.01):
            return Changed(sample.name, None)
        return Changed(sample.name, self._changed(dice, sample), dice.chance(self.deep))

    def door(self, case: Changed) -> str | None:
        """Put the file there, read the folder, and put back what it was."""
        path = self.place / case.name
        before = path.read_bytes()
        try:
            path.unlink() if case.data is None else path.write_bytes(case.data)
            return self.read(self.place, deep=case.deep)
        except BadInput as error:
            check_file_line(error)
            raise
        finally:
            path.write_bytes(before)

    def _changed(self, dice: Dice, sample: Changed) -> bytes:
        data, suffix = sample.data or b"", Path(sample.name).suffix
        alike = [of.data or b"" for of in self.samples if Path(of.name).suffix == suffix]
        try:
            if dice.chance(0.4):
                pass
            elif suffix == ".json":
                trees = [json.loads(other) for other in alike]
                return json.dumps(changed_inside(dice, json.loads(data), trees, self.inner)).encode()
            elif suffix == ".jsonl":
                return _changed_line(dice, data)
            elif suffix == ".toml":
                tables = [tomllib.loads(other.decode()) for other in alike]
                return tomli_w.dumps(changed_inside(dice, tomllib.loads(data.decode()), tables, self.inner)).encode()
            elif suffix == ".csv":
                return _changed_cell(dice, data)
        except (TypeError, ValueError, AttributeError, RecursionError):  # it cannot say it
            pass
        return changed_bytes(dice, data, alike)


def _changed_line(dice: Dice, data: bytes) -> bytes:
    lines = data.splitlines()
    at = dice.below(len(lines))
    others = [json.loads(line) for line in lines]
    lines[at] = json.dumps(changed_tree(dice, others[at], others)).encode()
    return b"\n".join(lines) + b"\n"


def _changed_cell(dice: Dice, data: bytes) -> bytes:
    """A cell, a column's name, or the order of lines."""
    rows = [line.split(",") for line in data.decode().splitlines()]
    for _ in range(dice.few(4)):
        row = dice.below(len(rows)) if dice.chance(0.8) else 0
        at = dice.below(len(rows[row]))
        what: Any = dice.below(8)
        if what == 0:
            del rows[row][at]
        elif what == 1 and len(rows) > 2:
            rows[row], rows[-1] = rows[-1], rows[row]
        elif what == 2:
            rows.insert(row, list(rows[row]))
        else:
            rows[row][at] = dice.pick((*CELLS, *CELLS, *CELLS, dice.pick(TEXTS)))
        if not rows[row]:
            rows[row] = [""]
    return "\n".join(",".join(row) for row in rows).encode(errors="surrogatepass") + b"\n"
