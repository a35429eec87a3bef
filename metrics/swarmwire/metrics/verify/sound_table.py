"""A table of a run folder for who relies on all that it says."""

from typing import TYPE_CHECKING

from swarmwire.comms.errors import BadInput
from swarmwire.metrics.run_folder import RunFolder
from swarmwire.metrics.verify.table_faults import table_fault

if TYPE_CHECKING:
    import polars as pl


def sound_table(run: RunFolder, name: str, table: "pl.DataFrame") -> "pl.DataFrame":
    """The table `name` of this run as it was read; BadInput, which names file and fault, for what cannot be in it."""
    fault = table_fault(name, table.lazy(), run.static)
    if fault is None:
        return table
    expected = f"expected a table as a run writes it, but {fault}; see swarmwire verify"
    raise BadInput(run.where(name), "", expected)
