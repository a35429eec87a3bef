"""What is wrong in a table of a run folder that can be read: types, missing values, robots that there are not."""

from typing import TYPE_CHECKING, Any

from swarmwire.comms.truth import Static
from swarmwire.metrics.record.tick_columns import VALUE, tick_schema
from swarmwire.metrics.run_folder import SCHEMAS

if TYPE_CHECKING:
    import polars as pl

MAY_BE_NULL = {
    "packets": ("receiver", "to", "rssi_dbm", "distance_m", "payload"),
    "radio_distances": ("pdr",),
}
ROBOTS = ("sender", "receiver", "to")  # columns with indices of robots
TOLERANCE = 1e-9  # of a ratio


def table_fault(name: str, table: "pl.LazyFrame", static: Static | None) -> str | None:
    """The first fault in words, None if there is none; without `static` robots and arenas are not checked."""
    there = table.collect_schema()
    return (
        _type_fault(there, _schema(name, static))
        or (_value_fault(name, table, static) if name in SCHEMAS else None)
        or (_ratio_fault(table) if name == "radio_distances" else None)
        or (_names_fault(table, static) if name == "radio_robots" and static else None)
    )


def _schema(name: str, static: Static | None) -> "dict[str, Any]":
    if name in SCHEMAS:
        return SCHEMAS[name]()
    return {} if static is None else tick_schema(static, (), with_value=True)


def _type_fault(there: "pl.Schema", expected: "dict[str, Any]") -> str | None:
    for column, kind in expected.items():
        found = there.get(column)
        if found is None:
            if column != VALUE:  # only there once a robot has told one
                return f"no column {column}"
        elif found != kind:
            return f"{column} is of type {found}, expected {kind}"
    return None


def _value_fault(name: str, table: "pl.LazyFrame", static: Static | None) -> str | None:
    """A value that is missing, no number, below 0, or an index of nothing."""
    import polars as pl

    wrong: dict[str, pl.Expr] = {}
    below = {} if static is None else {"arena": static.arenas, **dict.fromkeys(ROBOTS, static.robots)}
    for column, kind in table.collect_schema().items():
        of = pl.col(column)
        if column not in MAY_BE_NULL.get(name, ()):
            wrong[f"{column} is null"] = of.is_null()
            if kind.is_float():
                wrong[f"{column} is no finite number"] = ~of.is_finite()
        if kind.is_integer():
            wrong[f"{column} is below 0"] = of < 0
        if column in below:
            wrong[f"{column} is beyond {below[column] - 1}, the last of static.json"] = of >= below[column]
    counted = table.select(expression.sum().alias(text) for text, expression in wrong.items()).collect().row(0)
    for text, rows in zip(wrong, counted, strict=True):
        if rows:
            return f"{text} in {rows} row{'s' if rows != 1 else ''}"
    return None


def _ratio_fault(table: "pl.LazyFrame") -> str | None:
    import polars as pl

    apart = (pl.col("pdr") * pl.col("intended") - pl.col("received")).abs() > TOLERANCE * pl.col("intended") + TOLERANCE
    rows = table.filter(apart).select(pl.len()).collect().item()
    return f"pdr is not received / intended in {rows} row{'s' if rows != 1 else ''}" if rows else None


def _names_fault(table: "pl.LazyFrame", static: Static) -> str | None:
    """Robots stand in the order of static.json, arena after arena."""
    found = table.select("arena", "robot").collect().rows()
    expected = [(arena, robot) for arena in range(static.arenas) for robot in static.robot_names]
    if len(found) != len(expected):
        return f"{len(found)} robots; static.json has {len(expected)}"
    for (arena, robot), other in zip(expected, found, strict=True):
        if (arena, robot) != other:
            return f"{other[1]} (arena {other[0]}) stands in the place of {robot} (arena {arena}) of static.json"
    return None
