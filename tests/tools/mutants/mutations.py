"""Mutations of a module: one change each, by the operators of cosmic-ray.

The operators replace comparisons and arithmetic by others, add a `not`, turn `and` into `or`, change numbers by one,
take decorators away, and skip the bodies of loops. For one place there may be eleven replacements; most die of the same
test, so that some of each place are drawn, by a hash that changes only with the line.
"""

import ast
import importlib.util
import warnings
from collections import defaultdict
from hashlib import blake2b
from pathlib import Path
from typing import Any

from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names

from tests.tools.mutants.mutant import Mutant, is_inside

# For types and small numbers these say the same; elsewhere the linter refuses `is` where `==` is meant.
SAME = ("Eq_Is", "Is_Eq", "NotEq_IsNot", "IsNot_NotEq")
COMPILERS = ("@njit", "@borrowing")  # the compiler is off where mutants are tried, so that these do nothing


def path_of(module: str) -> Path:
    """The file of a module, which is not imported for that."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"{module}: expected a module of this project")
    return Path(spec.origin)


def mutants_of(module: str, each: int) -> list[Mutant]:
    """The mutants of a module in the order of its lines, `each` of every place and kind of change."""
    path = path_of(module)
    source = path.read_text()
    drawn = [choice for choices in _places(source).values() for choice in sorted(choices, key=_drawn)[:each]]
    made = [_mutant(module, path, source, operator, occurrence) for _, operator, occurrence in drawn]
    return sorted((mutant for mutant in made if mutant), key=lambda mutant: (mutant.line, mutant.after))


def _drawn(choice: tuple[str, Any, int]) -> str:
    return choice[0]


def _places(source: str) -> dict[tuple[Any, str], list[tuple[str, Any, int]]]:
    """By place and kind of change: what may be done there, as (hash to draw by, operator, number of its occurrence)."""
    found: dict[tuple[Any, str], list[tuple[str, Any, int]]] = defaultdict(list)
    tree, lines, types = get_ast(source), source.split("\n"), _annotations(source)
    for name in operator_names():
        made = get_operator(name)
        if made.arguments() or name.endswith(SAME):
            continue  # those with arguments replace variables by others, and want to be told which
        operator = made()
        starts = [start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)]
        for occurrence, (line, column) in enumerate(starts):
            text = lines[line - 1]
            if text.lstrip().startswith(COMPILERS) or any(first <= (line, column) < end for first, end in types):
                continue
            drawn = blake2b(f"{text} {column} {name} {occurrence - starts.index((line, column))}".encode()).hexdigest()
            found[(line, column), name.split("_")[0]].append((drawn, operator, occurrence))
    return found


def _annotations(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where the types stand: a change there either does nothing or breaks the import, and says nothing of the tests."""
    nodes = list(ast.walk(ast.parse(source)))
    held = [getattr(node, name, None) for node in nodes for name in ("annotation", "returns")]
    return [
        ((of.lineno, of.col_offset), (of.end_lineno or 0, of.end_col_offset or 0))
        for of in held
        if isinstance(of, ast.expr)
    ]


def _mutant(module: str, path: Path, source: str, operator: Any, occurrence: int) -> Mutant | None:
    """The mutant, or None if it is no Python or the same program."""
    try:
        changed = mutate_code(source, operator, occurrence)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            same = ast.dump(ast.parse(changed)) == ast.dump(ast.parse(source))
    except (SyntaxError, AttributeError):  # cosmic-ray cannot replace exceptions with a dot in their names
        return None
    if same:
        return None
    olds, news = source.split("\n"), changed.split("\n")
    at = next(at for at, (old, new) in enumerate(zip(olds, news, strict=False)) if old.strip() != new.strip())
    after = "" if len(news) < len(olds) else news[at].strip()
    return Mutant(module, path, at + 1, olds[at].strip(), after, changed, is_inside(at + 1, source))
