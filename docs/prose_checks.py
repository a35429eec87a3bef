"""Words that pages, command help, messages and public docstrings do not use, each with the replacement to write.

Code is not prose: fenced blocks, code spans and link targets are skipped in pages, code spans in docstrings.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.docs.pages import PAGES

ROOT = Path(__file__).parents[1]
PARTS = ("agent", "comms", "world", "metrics", "deploy")

WORDS: dict[str, str] = {  # a regular expression, and the replacement to suggest
    r"whatever": "any, every, or the noun",
    r"who(?:so)?ever": "the process, the user, the robot that",
    r"whom(?:ever)?": "the noun: the receiver, the owner",
    r"tells?|told|telling": "report, show, state, command, distinguish",
    r"nobody|somebody": "the noun: no process, a user; or the passive",
    r"anew": "again",
    r"what (?:came|comes|becomes?|became|has become) of": "the result, the outcome, the fate",
    r"mend(?:s|ed|ing)?": "fix, repair, restore",
    r"(?:go|goes|went|gone|going) on(?! air\b)": "continue, run, last",
    r"founding papers?": "replicated experiments",
}
PATTERNS = {
    re.compile(rf"\b(?:{word})\b".replace(" ", r"\s+"), re.IGNORECASE): instead for word, instead in WORDS.items()
}

FENCE = re.compile(r"^ *(```+|~~~+)[^\n]*\n.*?^ *\1 *$", re.DOTALL | re.MULTILINE)
SPAN = re.compile(r"(`+).+?\1", re.DOTALL)
TARGET = re.compile(r"\]\([^)]*\)")
ATTRIBUTE = re.compile(r"^ +\w+: ", re.MULTILINE)  # its name, in a docstring


def prose() -> Iterator[str]:
    """A line for each word in a page, a message, a help text or a public docstring that WORDS replaces."""
    for page in PAGES:
        yield from _problems(page, 1, (ROOT / page).read_text(encoding="utf-8"))
    for file in (file for part in PARTS for file in sorted((ROOT / part / "swarmwire").rglob("*.py"))):
        name = str(file.relative_to(ROOT))
        for line, text in texts_of(file.read_text(encoding="utf-8")):
            yield from _problems(name, line, text)


def texts_of(source: str) -> Iterator[tuple[int, str]]:
    """The line and the text of each public docstring and of each message: a string of several words."""
    tree = ast.parse(source)
    docstrings = {id(text) for node in ast.walk(tree) if (text := _docstring(node))}
    yield from ((text.lineno, str(text.value)) for text in _public_docstrings(tree))
    for node in ast.walk(tree):
        if id(node) in docstrings or not isinstance(node, ast.Constant):
            continue
        if isinstance(node.value, str) and " " in node.value:
            yield node.lineno, node.value


def _problems(name: str, first: int, text: str) -> Iterator[str]:
    for skipped in (FENCE, SPAN, TARGET, ATTRIBUTE):
        text = skipped.sub(lambda code: re.sub(r"[^\n]", "\0", code[0]), text)
    for pattern, instead in PATTERNS.items():
        for match in pattern.finditer(text):
            line = first + text.count("\n", 0, match.start())
            words = " ".join(match[0].split())
            yield f"{name}:{line}: '{words}': expected {instead}"


def _public_docstrings(node: ast.AST) -> Iterator[ast.Constant]:
    if text := _docstring(node):
        yield text
    if isinstance(node, ast.Module | ast.ClassDef):
        for child in node.body:
            if not getattr(child, "name", "_").startswith("_"):
                yield from _public_docstrings(child)


def _docstring(node: ast.AST) -> ast.Constant | None:
    """The docstring of a module, a class or a function."""
    if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
        first = node.body[0]
        if isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str):
            return first.value
    return None
