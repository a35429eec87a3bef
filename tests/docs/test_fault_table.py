"""The page tells what `faults/` holds, and what its rows name is there."""

import ast

import pytest

from tests.tools.reliability.fault_table import ROOT, Proof, processes, proofs
from tests.tools.reliability.page import PAGE, written


def test_the_page_holds_the_tables_as_they_are():
    assert PAGE.read_text(encoding="utf-8") == written(), "python -m tests.tools.reliability writes it anew"


def test_every_row_has_a_proof():
    lacking = [fault.fault for process in processes() for fault in process.faults if not fault.proof]
    assert lacking == []


@pytest.mark.parametrize("proof", proofs(), ids=lambda proof: proof.test)
def test_a_proof_names_a_test_that_is_there_and_code_that_stands_once(proof: Proof):
    path, _, name = proof.test.partition("::")
    assert path.startswith("tests/")
    tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
    assert name.partition("[")[0] in {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert proof.changed() != proof.source()
    ast.parse(proof.changed())
