"""Results that nobody can change by mistake: the arrays in them are read-only."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def read_only(result: Result) -> Result:
    """The result, with all arrays in it, in its dataclasses, tuples and mappings, read-only."""
    todo: list[Any] = [result]
    seen: set[int] = set()
    while todo:
        value = todo.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        elif is_dataclass(value) and not isinstance(value, type):
            todo += [getattr(value, field.name) for field in fields(value)]
        elif isinstance(value, (tuple, list)):
            todo += value
        elif isinstance(value, Mapping):
            todo += value.values()
    return result


def gives_read_only(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Decorator: what the function returns is read-only."""

    @wraps(function)
    def given(*arguments: Arguments.args, **options: Arguments.kwargs) -> Result:
        return read_only(function(*arguments, **options))

    return given
