"""The names check of `make check`: identifiers are nouns and verbs of the field, and a class name occurs once.

`python -m tests.tools.names` prints every refused name as `file:line: name: expectation`; the exit code is then 1. It
refuses identifiers in all parts of the product, in the programs beside them and, fewer of them, in tests, and class
names that a part repeats.
`--counts` prints, for each part, the numbers of refused identifiers, and of docstrings and comments that point at the
code instead of describing it. `--texts` also lists those docstrings and comments, in every part.
"""

import argparse
import ast
import io
import re
import sys
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

PARTS = "comms", "agent", "world", "metrics", "deploy"
PROGRAMS = "docs", "benchmarks", "examples", "scenarios"
TESTS = "tests"

REFUSED = frozenset(
    (
        *("of", "place", "places", "found", "own", "known", "one", "ones", "some", "its", "whole", "rest", "thing"),
        *("given", "kept", "told", "tell", "tells", "say", "says", "said", "asked", "wanted", "mine", "made", "cure"),
        *("what", "there", "here", "beside", "around"),
    )
)

ALLOWED_IN_TESTS = "one", "own", "made", "mine", "places", "say", "says", "its", "around", "beside", "some", "wanted"

# file, identifier: reason
EXCEPTIONS: dict[tuple[str, str], str] = {
    ("agent/swarmwire/agent/behaviours/lennard_jones_flocking.py", "Here"): "a message; its class name makes its tag",
    ("deploy/swarmwire/deploy/campaigns/tuning/spec.py", "whole"): "key of tuning.json",
    ("metrics/swarmwire/metrics/records/run_folder/layout.py", "what"): "key of summary.json and campaign.json",
    ("world/swarmwire/world/events/radio_events.py", "what"): "key of a scenario's ramp",
    ("world/swarmwire/world/scenario/arena.py", "place"): "key of a scenario's obstacles and lights",
    ("world/swarmwire/world/scenario/scenario.py", "place"): "key of a scenario's robots",
    ("world/swarmwire/world/backends/runner_reports.py", "what"): "key of summary.json",
    ("tests/tools/stable/frames.py", "Told"): "a message; its class name makes its tag",
    ("tests/tools/stable/frames.py", "place"): "a message's field, which makes its tag too",
}

# class name: reason why it may occur more than once
REPEATED: dict[str, str] = {
    "Beacon": "messages of two behaviours; a message's class name makes its tag on air",
}

POINTING_DOCSTRING = re.compile(
    r"(As|Of|What|Whether|How|By|In|Where|So|Which|Who|That|When|From|To|With|For|Why|Those|It|They)\b"
)
POINTING_COMMENT = re.compile(
    r"(of|that|which|as|by|where|to|from|so|in|with|for|when|else|and|but|what|whose|it|they|those|than|also)\b"
)


EXPECTED = {
    "identifier": "expected a noun or verb of the field",
    "docstring": "expected a sentence with a verb, or a noun phrase",
    "comment": "expected a noun phrase, or a sentence",
}


class Breach(NamedTuple):
    """A line that the check refuses or counts."""

    kind: str  # a key of EXPECTED
    file: Path
    line: int
    text: str


def _identifiers(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and name of every variable, parameter, attribute, function, class and alias that a module defines.

    A Name or Attribute in Store context is the target of an assignment (annotated, augmented or `:=`), of a loop, of a
    comprehension, or of `with … as`. Names of `global` and `nonlocal` are such targets elsewhere.
    """
    for node in ast.walk(tree):
        name: str | None = None
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            name = node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            name = node.attr
        elif isinstance(node, ast.arg):
            name = node.arg
        elif isinstance(node, ast.alias):
            name = node.asname
        elif isinstance(node, ast.MatchMapping):
            name = node.rest
        elif isinstance(
            node,
            ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.ExceptHandler | ast.MatchAs | ast.MatchStar,
        ):
            name = node.name
        if name is not None:
            yield getattr(node, "lineno", 1), name


def _docstrings(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and first line of each docstring."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield getattr(node, "lineno", 1), text.splitlines()[0]


def _comments(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of each comment; the lines of a block count as one comment."""
    previous = -1
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type != tokenize.COMMENT:
            continue
        is_alone = token.line.lstrip().startswith("#")
        if not (is_alone and previous == token.start[0] - 1):
            yield token.start[0], token.string.lstrip("#: ")
        previous = token.start[0] if is_alone else -1


def breaches_of(root: Path, part: str) -> Iterator[Breach]:
    """Refused identifiers, and docstrings and comments that point, in the files of a part, of programs or of tests."""
    refused = REFUSED.difference(ALLOWED_IN_TESTS if part == TESTS else ())
    for path in sorted((root / part / ("swarmwire" if part in PARTS else "")).rglob("*.py")):
        source, file = path.read_text(), path.relative_to(root)
        tree = ast.parse(source)
        for line, name in [(1, path.stem), *_identifiers(tree)]:
            if name.strip("_").lower() in refused and (file.as_posix(), name) not in EXCEPTIONS:
                yield Breach("identifier", file, line, name)
        for line, text in _docstrings(tree):
            if POINTING_DOCSTRING.match(text):
                yield Breach("docstring", file, line, text)
        for line, text in _comments(source):
            if POINTING_COMMENT.match(text):
                yield Breach("comment", file, line, text)


def unused_exceptions(root: Path) -> list[tuple[str, str]]:
    """Return the exceptions whose file does not define the identifier."""
    return [
        (file, name)
        for file, name in EXCEPTIONS
        if not (root / file).is_file() or name not in {n for _, n in _identifiers(ast.parse((root / file).read_text()))}
    ]


def repeated_classes(root: Path) -> dict[str, list[str]]:
    """Public top-level class names that occur more than once in the product, with their files."""
    files = defaultdict[str, list[str]](list)
    for part in PARTS:
        for path in sorted((root / part / "swarmwire").rglob("*.py")):
            for node in ast.parse(path.read_text()).body:
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    files[node.name].append(path.relative_to(root).as_posix())
    return {name: listed for name, listed in sorted(files.items()) if len(listed) > 1 and name not in REPEATED}


def main() -> int:
    """Print the refused names, the texts or the counts; return 1 if the check refuses a name."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--counts", action="store_true", help="numbers for each part")
    parser.add_argument("--texts", action="store_true", help="list the docstrings and comments that point")
    parser.add_argument("--under", default="", help="only files whose path contains this text")
    options = parser.parse_args()
    root = Path(__file__).parents[2]
    breaches = {
        part: [b for b in breaches_of(root, part) if options.under in str(b.file)]
        for part in (*PARTS, *PROGRAMS, TESTS)
    }
    repeated = repeated_classes(root)
    if options.counts:
        for part, listed in breaches.items():
            counts = {kind: sum(b.kind == kind for b in listed) for kind in ("identifier", "docstring", "comment")}
            print(part, *(f"{number} {kind}s" for kind, number in counts.items()), sep=", ")
        print(f"{len(repeated)} repeated class names")
        return 0
    refused = False
    for listed in breaches.values():
        for breach in listed:
            is_refused = breach.kind == "identifier"
            if is_refused or options.texts:
                print(f"{breach.file}:{breach.line}: {breach.text}: {EXPECTED[breach.kind]}")
            refused |= is_refused
    for name, files in repeated.items():
        if any(file.split("/")[0] in PARTS and options.under in file for file in files):
            print(f"{files[0]}:1: {name}: expected one class of this name, got another in {', '.join(files[1:])}")
            refused = True
    for file, name in unused_exceptions(root):
        print(f"{file}:1: {name}: expected an identifier of this name, or no exception for it in tests/tools/names.py")
        refused = True
    return int(refused)


if __name__ == "__main__":
    sys.exit(main())
