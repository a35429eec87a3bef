"""A pytest plugin: what zenoh's threads call is looked at, too; coverage knows only threads that Python started."""

import functools
import sys
import threading
from collections.abc import Callable
from typing import Any

import zenoh

_Callback: Any = zenoh.handlers.Callback


def _looked_at(called: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(called)
    def call(*args: Any) -> Any:
        if sys.gettrace() is None:
            sys.settrace(threading.gettrace())
        return called(*args)

    return call


def _callback(called: Callable[..., Any], *more: Any, **settings: Any) -> Any:
    return _Callback(_looked_at(called), *more, **settings)


zenoh.handlers.Callback = _callback  # before anything that takes it from there is imported
