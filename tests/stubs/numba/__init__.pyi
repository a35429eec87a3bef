from collections.abc import Callable
from typing import Any, TypeVar

_F = TypeVar("_F", bound=Callable[..., Any])

# A compiled function is called as the function that it was made from.
def njit(
    *,
    cache: bool = ...,
    parallel: bool = ...,
    fastmath: bool = ...,
    nogil: bool = ...,
    inline: str = ...,
    boundscheck: bool = ...,
    error_model: str = ...,
) -> Callable[[_F], _F]: ...

prange = range

def get_num_threads() -> int: ...
def set_num_threads(n: int) -> None: ...
