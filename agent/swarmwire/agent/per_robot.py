"""PerRobot: a parameter of a VectorAgent that has a value for each robot."""

from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from swarmwire.comms.arrays import FloatArray, IntArray

T = TypeVar("T", int, float)


class PerRobot(Generic[T]):
    """Declares `lane: PerRobot[int] = per_robot(0)`, without default `lane: PerRobot[int]`.

    A scenario gives one number for all or a list with one for each robot, by its index in the group. In `step`,
    `self.lane` is the array (n,) of the robots that act: int64 or float64.
    """

    if TYPE_CHECKING:

        @overload
        def __get__(self: "PerRobot[int]", agent: object, owner: Any) -> IntArray: ...
        @overload
        def __get__(self: "PerRobot[float]", agent: object, owner: Any) -> FloatArray: ...
        def __get__(self, agent: object, owner: Any) -> Any: ...


class PerRobotDefault:
    """One number for all robots, unless the scenario says otherwise."""

    def __init__(self, value: float) -> None:
        self.value = value


def per_robot(default: float) -> Any:
    """The default of a PerRobot parameter: one number for all robots."""
    return PerRobotDefault(default)
