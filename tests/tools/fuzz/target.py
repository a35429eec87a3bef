"""Fuzzing targets: an entry point of the product, samples that it accepts, and the errors that it may refuse with.

`run_case` runs one case within limits of time and memory.
"""

import gc
import re
import resource
import signal
import sys
from abc import ABC, abstractmethod
from collections.abc import Generator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from swarmwire.comms.base.errors import BadFrame, BadInput
from tests.tools.fuzz.mutations import CODECS, MSGPACK, Codec, mutated_bytes, mutated_document, one_in, pick

ACCEPTED = "accepted"
MAX_LINE = 2000  # characters of a refusal
MAX_CASE_MB = 300  # that the peak of the process may grow by in one case


class Target(ABC):
    """An entry point. A case is one input; what it must not do raises AssertionError.

    Attributes:
        name: of its test.
        refusals: errors that refuse a case; any other error, and any warning, is a finding.
        quick: about how many cases in the test suite.
        soak: about how many in a soak.
        per_example: most cases of an example of Hypothesis, which by itself costs more than most cases.
        limit_s: of processor time for a case.
    """

    name: ClassVar[str]
    refusals: ClassVar[tuple[type[Exception], ...]] = (BadFrame,)
    quick: ClassVar[int] = 120
    soak: ClassVar[int] = 10_000
    per_example: ClassVar[int] = 20
    limit_s: ClassVar[float] = 5.0

    def __init__(self, folder: Path) -> None:
        """`folder` is the target's own, empty."""
        self.folder = folder
        self.samples = self.make_samples()

    @abstractmethod
    def make_samples(self) -> Sequence[Any]:
        """Cases that raise no finding, and of which some are accepted."""

    @abstractmethod
    def mutated(self, draw: DrawFn) -> Any:
        """A sample, mutated."""

    @abstractmethod
    def feed(self, case: Any) -> str | None:
        """Hand a case in: in a word why it was refused, or None. Refusals may be raised."""

    def cases(self) -> SearchStrategy[Any]:
        """Mutated samples."""
        return st.composite(self.mutated)()


class ByteTarget(Target):
    """Of bytes, such as a packet."""

    def mutated(self, draw: DrawFn) -> Any:
        return mutated_bytes(draw, pick(draw, self.samples), self.samples)


class DocumentTarget(Target):
    """Of documents: most cases mutate their tree, so that they get past the codec."""

    codec: ClassVar[Codec] = MSGPACK
    inner: ClassVar[tuple[str, ...]] = ()  # keys below which most of a document is

    def mutated(self, draw: DrawFn) -> Any:
        return mutated_document(draw, pick(draw, self.samples), self.samples, self.codec, self.inner)


class FrameTarget(DocumentTarget):
    """Of frames."""

    inner = ("arrays", "arrays", "values")


class File(NamedTuple):
    """A file of a folder; without data it is missing."""

    name: str
    data: bytes | None
    deep: bool = False  # whether the case goes on to what costs most


class FolderTarget(Target):
    """Of a folder, in which a case changes one file."""

    refusals = (BadInput,)
    inner: ClassVar[tuple[str, ...]] = ()
    deep: ClassVar[int] = 50  # one case of so many is deep
    quick = 20
    per_example = 1

    def make_samples(self) -> Sequence[File]:
        self.path = self.folder / "sample"
        self.make(self.path)
        paths = sorted(path for path in self.path.rglob("*") if path.is_file() and self.is_read(path))
        self.files = [File(str(path.relative_to(self.path)), path.read_bytes(), deep=True) for path in paths]
        return self.files[:1]  # the folder as it is

    @abstractmethod
    def make(self, folder: Path) -> None:
        """Fill the folder, which does not exist."""

    @abstractmethod
    def read(self, folder: Path, *, deep: bool) -> str | None:
        """Read the folder; BadInput names the file."""

    def is_read(self, path: Path) -> bool:
        """Whether a file of the folder is read at all."""
        return path.suffix in (".json", ".jsonl", ".toml", ".csv", ".parquet", ".bin", ".pem", ".txt", ".log")

    def mutated(self, draw: DrawFn) -> Any:
        file = pick(draw, self.files)
        if one_in(draw, 100):
            return File(file.name, None)
        return File(file.name, mutated_file(draw, file, self.files, self.inner), one_in(draw, self.deep))

    def feed(self, case: File) -> str | None:
        path = self.path / case.name
        before = path.read_bytes()
        try:
            path.unlink() if case.data is None else path.write_bytes(case.data)
            return self.read(self.path, deep=case.deep)
        except BadInput as error:
            check_refusal(error)
            raise
        finally:
            path.write_bytes(before)


def mutated_file(draw: DrawFn, file: File, files: Sequence[File], inner: Sequence[str]) -> bytes:
    """The data of one of these files, mutated as its format is."""
    suffix, data = Path(file.name).suffix, file.data or b""
    corpus = [other.data or b"" for other in files if Path(other.name).suffix == suffix]
    if suffix in CODECS:
        return mutated_document(draw, data, corpus, CODECS[suffix], inner)
    return mutated_bytes(draw, data, corpus)


class TimeLimitExceeded(BaseException):
    """A case over its limit: no handler of errors in the product may catch it."""


def run_case(target: Target, case: Any) -> str:
    """The kind of the refusal, or ACCEPTED; AssertionError or the error itself if it is a finding."""
    before_mb = _peak_mb()
    try:
        with _limited(target.limit_s):
            kind = target.feed(case) or ACCEPTED
    except target.refusals as error:
        kind = refusal_kind(error)
    except TimeLimitExceeded as error:
        raise AssertionError(f"over {target.limit_s:g} s of processor time") from error
    except (Exception, KeyboardInterrupt):
        raise
    except BaseException as error:  # a panic of native code; Hypothesis would not take it for a failure
        raise AssertionError(f"{type(error).__name__}: {error}") from error
    grown_mb = _peak_mb() - before_mb
    if grown_mb > MAX_CASE_MB:
        gc.collect()
        with suppress(OSError):  # Linux: the peak begins anew, so that Hypothesis finds the same again
            Path("/proc/self/clear_refs").write_text("5")
        raise AssertionError(f"{grown_mb} MB at its peak, over {MAX_CASE_MB} MB")
    return kind


@contextmanager
def _limited(limit_s: float) -> Generator[None]:
    """TimeLimitExceeded after so much processor time of this process: the load of others does not count."""

    def stop(_signal: int, _frame: object) -> None:
        raise TimeLimitExceeded

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def _peak_mb() -> int:
    """The most memory that this process has had."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak >> (20 if sys.platform == "darwin" else 10)


def refusal_kind(error: Exception) -> str:
    """The class of a refusal and the first words of what it says, without names and numbers."""
    text = error.expected if isinstance(error, BadInput) else str(error)
    words = re.sub(r"'[^']*'|\"[^\"]*\"|\S*[\d/_]\S*", "…", text.partition("\n")[0]).split()
    return " ".join((type(error).__name__, *words[:5]))


def check_line(error: BadInput) -> None:
    """A refusal is one printable line of bounded length."""
    text = str(error)
    if not text.isprintable() or len(text) > MAX_LINE:
        raise AssertionError(f"a refusal that is not one readable line: {text[:300]!r}")


def check_refusal(error: BadInput, named: str = "") -> None:
    """A refusal of a file is such a line, and names the file."""
    check_line(error)
    if named not in str(error) or not error.where:
        raise AssertionError(f"a refusal that does not name {named or 'a file'}: {str(error)[:300]!r}")
