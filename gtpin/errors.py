"""The errors of gtpin: each says what is wrong, where, and what to do."""

from __future__ import annotations

import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from types import FrameType
from typing import Any, ParamSpec, TypeVar

LONGEST = 1000
"""Largest length of a message, in characters; the middle of a longer one is left out."""


CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Characters that give a terminal orders or change the direction of writing, such as ESC; without tabs and line ends."""


def harmless(text: str) -> str:
    """A text in one line for the terminal: control characters are written as escapes, such as ``\\x1b``."""
    return CONTROL.sub(lambda found: found[0].encode("unicode_escape").decode(), " ".join(text.split()))


P = ParamSpec("P")
T = TypeVar("T")


class GtpinError(Exception):
    """The base class of gtpin's errors: an input that gtpin can't use, or a result that it can't give.

    Parameters
    ----------
    what
        What is wrong, in one sentence without a full stop.
    file, row, column
        Where it is wrong: the file, the line number in it (1 is the header of a table), the column or key. None where unknown.
    hint
        What to do about it; None where nothing can be said.

    Examples
    --------
    >>> import gtpin
    >>> try:
    ...     gtpin.load_robot("gantry_tao")
    ... except gtpin.GtpinError as error:
    ...     print(error.what)
    no robot is called 'gantry_tao'
    """

    def __init__(
        self,
        what: str,
        *,
        file: Path | str | None = None,
        row: int | None = None,
        column: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.what = what
        self.file = file
        self.row = row
        self.column = column
        self.hint = hint
        super().__init__(str(self))

    def __str__(self) -> str:
        where = [str(self.file)] if self.file is not None else []
        where += [f"row {self.row}"] if self.row is not None else []
        where += [f"column {self.column}"] if self.column is not None else []
        text = f"{', '.join(where)}: {self.what}" if where else self.what
        text = harmless(f"{text}; {self.hint}" if self.hint else text)
        if len(text) > LONGEST:  # a name or a value of thousands of letters hides what was wrong and what to do
            text = f"{text[: LONGEST // 2]} [...] {text[-LONGEST // 2 :]}"
        return text


class RobotError(GtpinError):
    """A robot description that can't be read, or that is no robot."""


class DatasetError(GtpinError):
    """A dataset that can't be read, or whose numbers can't be right; or data that do not have what was asked for."""


class ModelError(GtpinError):
    """A model that can't be read, or an argument that does not fit a model or a robot."""


class ClosureError(GtpinError):
    """The loops can't be closed at the commands or the pose that were asked for."""


class UnreachableError(ClosureError):
    """No posture closes the loops at these commands, or brings the TCP to this pose."""


class SingularityError(ClosureError):
    """The posture is too near a singularity, or the path to it passes too near one."""


class AssemblyModeError(ClosureError):
    """The posture belongs to another assembly mode than the robot's home."""


class ConvergenceError(GtpinError):
    """A solver that did not converge; its last iterate is not a result."""


class GtpinWarning(UserWarning):
    """A warning: gtpin found something unusual in the data, did not use some rows, or made an assumption.

    Examples
    --------
    >>> import warnings
    >>> import gtpin
    >>> warnings.simplefilter("error", gtpin.GtpinWarning)  # a warning is an error from here on
    """


def listed(names: Sequence[str], most: int = 12) -> str:
    """The first names as a text, and how many more there are."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


GIVE = {
    "Dataset": ("Dataset", "read it: gtpin.Dataset.read(FOLDER)"),
    "Model": ("Model", "give the .model of a calibration or diagnosis, or gtpin.read_model(PATH)"),
    "Chain": ("Robot", "load it: gtpin.load_robot(NAME or PATH)"),
}
"""By class, its name to users and how they get one."""


def check_kind(value: object, *kinds: type) -> None:
    """Raise `ModelError` if an argument is of none of these classes of ``GIVE``, such as a path instead of a dataset."""
    if not isinstance(value, kinds):
        names, hints = zip(*(GIVE[kind.__name__] for kind in kinds if kind.__name__ in GIVE), strict=True)
        raise ModelError(f"a {type(value).__name__} where a {' or '.join(names)} must be", hint=hints[0])


_notes: ContextVar[tuple[list[str], ...]] = ContextVar("notes", default=())
"""Lists that take the texts of warnings, of all :func:`noted` blocks that are open."""


@contextmanager
def noted() -> Iterator[list[str]]:
    """Context that lists the texts of the warnings in it, for a result; they are issued all the same."""
    texts: list[str] = []
    token = _notes.set((*_notes.get(), texts))
    try:
        yield texts
    finally:
        _notes.reset(token)


@contextmanager
def unheard() -> Iterator[None]:
    """Context whose gtpin warnings are neither issued nor noted: of steps that are not the result."""
    token = _notes.set(())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", GtpinWarning)
            yield
    finally:
        _notes.reset(token)


@contextmanager
def deferred() -> Iterator[list[str]]:
    """Context whose gtpin warnings are issued at its end, or with its error. It gives the list of them, to be changed."""
    texts: list[str] = []
    try:
        with unheard(), noted() as texts:
            yield texts
    finally:
        for text in texts:
            warn(text)


def withdraw(texts: Sequence[str]) -> None:
    """Take warnings back that are :func:`deferred`: what they say was of a step that another one replaces."""
    for noted_ in _notes.get():
        noted_[:] = [text for text in noted_ if text not in texts]


def warn(text: str, category: type[Warning] = GtpinWarning) -> None:
    """Issue a warning whose place is the line of the user's code that called gtpin."""
    text = harmless(text)
    for texts in _notes.get():
        texts.append(text)
    frame = user = sys._getframe(1)
    while frame.f_back is not None:
        called, frame = frame, frame.f_back
        if _is_gtpin(called) and not _is_gtpin(frame):
            user = frame
    names = user.f_globals
    registry = names.setdefault("__warningregistry__", {})
    name = names.get("__name__", "<unknown>")
    warnings.warn_explicit(text, category, user.f_code.co_filename, user.f_lineno, name, registry)


def renamed(old: str, new: str) -> Any:
    """A deprecated property ``old``: it warns, and is the attribute ``new``. It goes with version 0.4."""

    def read(one: Any) -> Any:
        warn(f"{old} is now called {new}; the old name goes with version 0.4", DeprecationWarning)
        return getattr(one, new)

    return property(read)


def renamed_names(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """The ``__getattr__`` of a module with deprecated names, by their old ones: it warns, and gives the new one. They go with
    version 0.4."""

    def read(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        warn(f"{name} is now called {names[name]}; the old name goes with version 0.4", DeprecationWarning)
        return getattr(sys.modules[module], names[name])

    return read


def renamed_argument(old: str, new: str) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """A function that also takes the keyword ``new`` by its deprecated name ``old``, which goes with version 0.4."""

    def wrap(function: Callable[P, T]) -> Callable[P, T]:
        @wraps(function)
        def called(*args: P.args, **kwargs: P.kwargs) -> T:
            if old in kwargs:
                warn(f"{old} is now called {new}; the old name goes with version 0.4", DeprecationWarning)
                kwargs[new] = kwargs.pop(old)
            return function(*args, **kwargs)

        return called

    return wrap


def _is_gtpin(frame: FrameType) -> bool:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0] == "gtpin"
