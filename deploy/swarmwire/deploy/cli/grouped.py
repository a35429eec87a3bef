"""Commands whose options are the fields of a dataclass."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from typing import Any, TypeVar, get_type_hints

OptionsT = TypeVar("OptionsT")


def with_options(command: Callable[[OptionsT], None]) -> Callable[..., None]:
    """Return the typer command of a function whose only parameter is a dataclass of arguments and options.

    A field that is itself a dataclass is a group of options, which several commands can share.
    """
    kind: type[Any] = next(iter(get_type_hints(command).values()))
    parameters = list(_parameters(kind))

    @wraps(command)
    def typer_command(**values: Any) -> None:
        command(_instance(kind, values))

    signature = inspect.Signature(parameters)
    typer_command.__signature__ = signature  # pyright: ignore[reportAttributeAccessIssue] - typer reads it
    typer_command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return typer_command


def _parameters(kind: type[Any]) -> Iterator[inspect.Parameter]:
    """Return a parameter for each option, groups in the order of their fields."""
    hints = get_type_hints(kind, include_extras=True)
    for option in fields(kind):
        hint = hints[option.name]
        if is_dataclass(hint):
            yield from _parameters(hint)  # pyright: ignore[reportArgumentType] - a class, not an instance
        else:
            default = inspect.Parameter.empty if option.default is MISSING else option.default
            keyword = inspect.Parameter.KEYWORD_ONLY
            yield inspect.Parameter(option.name, keyword, default=default, annotation=hint)


def _instance(kind: type[OptionsT], values: Mapping[str, Any]) -> OptionsT:
    hints = get_type_hints(kind)
    names = [option.name for option in fields(kind)]  # pyright: ignore[reportArgumentType] - a dataclass
    return kind(
        **{name: _instance(hints[name], values) if is_dataclass(hints[name]) else values[name] for name in names}
    )
