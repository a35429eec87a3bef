"""A mutant: a module with one change."""

import ast
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Mutant:
    """One change of a module."""

    module: str  # its name, for import
    path: Path
    line: int  # of the change, from 1
    before: str  # what stands there
    after: str
    source: str  # of the module, changed
    is_inside: bool  # the body of a function, and so nothing that is done when the module is imported


def is_inside(line: int, source: str) -> bool:
    """Whether the line is in the body of a function."""
    functions = [of for of in ast.walk(ast.parse(source)) if isinstance(of, ast.FunctionDef)]
    return any(of.body[0].lineno <= line <= (of.end_lineno or 0) for of in functions)
