"""The chain is what its order says: a stage a module."""

import pytest

from swarmwire.comms.air.stages.chain import ORDER
from swarmwire.comms.air.stages.stage import Stage


@pytest.mark.parametrize("module", ORDER, ids=lambda module: module.__name__.rpartition(".")[2])
def test_each_module_of_the_order_holds_one_stage(module):
    kinds = [of for of in vars(module).values() if isinstance(of, type) and issubclass(of, Stage) and of is not Stage]
    assert [kind.__module__ for kind in kinds] == [module.__name__]
