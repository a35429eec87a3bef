"""VectorAgent: the code that controls n robots at a time, and its Memory, a table with a row per robot."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Self, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from swarmwire.agent.parameters import Parametrized
from swarmwire.agent.robots import Robots
from swarmwire.comms.base.arrays import FloatArray, IntArray
from swarmwire.comms.robot.bodies.body import Body

FloatColumn = NDArray[np.float64]  # float64, (n,), or (n, width)
IntColumn = NDArray[np.int64]  # int64, (n,), or (n, width)
BoolColumn = NDArray[np.bool_]  # bool, (n,), or (n, width)
DTYPES = ((FloatColumn, np.float64), (IntColumn, np.int64), (BoolColumn, np.bool_))

#: The `api` of an agent class; incremented when existing agents would no longer run, or would behave differently.
API_VERSION = 1

FROZEN = "_frozen"  # attribute of a VectorAgent that was constructed


class _Default:
    """The initial value of a column of a Memory."""

    def __init__(self, value: float | int | bool, width: int) -> None:
        self.value, self.shape = value, (width,) if width else ()


def column(default: float | int | bool, width: int = 0) -> Any:
    """Declare a column of a Memory: `count: IntColumn = column(0)`; a new robot's row starts with `default`.

    With a `width` each robot has `width` numbers, (n, width), which all start with `default`.
    """
    return _Default(default, width)


class Memory:
    """The memory of a VectorAgent: a table with a row per robot, whose arrays `step` reads and writes in place.

    The framework owns it: rows are added, removed and moved to another runner with their robots.
    """

    columns: ClassVar[dict[str, tuple[np.dtype[Any], float | int | bool, tuple[int, ...]]]] = {}

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.columns = dict(cls.columns)
        for name, hint in get_type_hints(cls).items():
            default, dtypes = getattr(cls, name, None), [dtype for column, dtype in DTYPES if column == hint]
            if name != "columns" and hasattr(Memory, name):
                raise TypeError(f"{cls.__name__}.{name}: the name is reserved by Memory")
            if isinstance(default, _Default) and dtypes:
                cls.columns[name] = (np.dtype(dtypes[0]), default.value, default.shape)
            elif name != "columns":
                raise TypeError(
                    f"{cls.__name__}.{name}: expected FloatColumn, IntColumn or BoolColumn = column(default)"
                )

    @classmethod
    def fresh(cls, n: int) -> Self:
        """Return the memory of n new robots."""
        memory = cls()
        for name, (dtype, default, shape) in cls.columns.items():
            object.__setattr__(memory, name, np.full((n, *shape), default, dtype))
        return memory

    def __setattr__(self, name: str, value: Any) -> None:
        """Copy the value into the column, so that its length and dtype stay."""
        if name not in self.columns:
            raise AttributeError(
                f"{type(self).__name__} has no column {name!r}; it has {', '.join(self.columns) or 'none'}"
            )
        column = getattr(self, name)
        if not np.can_cast(np.asarray(value).dtype, column.dtype, "same_kind"):
            raise TypeError(f"{type(self).__name__}.{name}: expected {column.dtype}, got {np.asarray(value).dtype}")
        column[...] = value

    def moved(self, old_rows: IntArray, new_rows: IntArray) -> Self:
        """Return the memory of the robots `new_rows`, copied for those in `old_rows`; others start with defaults.

        Both are rising robot rows.
        """
        memory = type(self).fresh(len(new_rows))
        _, old, new = np.intersect1d(old_rows, new_rows, assume_unique=True, return_indices=True)
        for name in self.columns:
            getattr(memory, name)[new] = getattr(self, name)[old]
        return memory


if TYPE_CHECKING:
    from typing_extensions import TypeVar as DefaultTypeVar

    S = DefaultTypeVar("S", bound=Memory, default=Memory)
else:
    S = TypeVar("S", bound=Memory)


class VectorAgent(Parametrized, ABC, Generic[S]):
    """Controls the robots of a group, n at a time, each row from its own sensors and packets alone.

    One instance serves all robots of a group in a process, over all arenas, so attributes of `self` cannot be set after
    `__init__`: they are its parameters (annotated class attributes, like those of an Agent, or `PerRobot`) and values
    that `__init__` derives from them. The memory of its robots is in its Memory, a type parameter: `class
    Search(VectorAgent[Walked])`. `api = 1` is explained at Agent.
    """

    api: ClassVar[int] = API_VERSION
    needs: ClassVar[tuple[str, ...]] = ()
    _is_vector: ClassVar[bool] = True

    def __setattr__(self, name: str, value: object) -> None:
        if FROZEN in vars(self):
            raise AttributeError(
                f"{type(self).__name__}.{name}: one instance serves many robots; memory goes into a Memory"
            )
        super().__setattr__(name, value)

    @classmethod
    def check_body(cls, body: Body) -> None:
        """Check the robots' body, which has the sensors that `needs` names, before a run.

        Override it to raise ValueError, in one line, for a body that the agent cannot control.
        """

    @abstractmethod
    def step(self, robots: Robots, memory: S) -> None:
        """Read `robots`, then drive and send; called once per tick with the robots that act in it."""

    def on_receive(self, robots: Robots, memory: S) -> None:
        """Read packets and send; called between steps, like that of an Agent, with the last step's robots. Optional."""


def freeze(agent: VectorAgent[Any], per_robot: dict[str, FloatArray | IntArray]) -> None:
    """Refuse any further assignment to an agent's attributes; another call sets parameters per robot."""
    vars(agent).update(per_robot, **{FROZEN: True})


def memory_class(kind: type[VectorAgent[Any]]) -> type[Memory]:
    """Return the class of Memory of a VectorAgent class; without one, the empty Memory."""
    for base in kind.__mro__:
        for generic in getattr(base, "__orig_bases__", ()):
            for arg in get_args(generic):
                if isinstance(arg, type) and issubclass(arg, Memory):
                    return arg
    return Memory
