"""Parts of gtpin, and of other packages, that are registered by entry points: nothing else imports them.

Groups:

- ``gtpin.commands``: :class:`~gtpin.commands.entry.CommandEntry`, a command of the command line;
- ``gtpin.readers``: what makes a URDF of another kind of robot file, from its outer element, its path and a keyframe's name;
- ``gtpin.writers``: :class:`~gtpin.export.writer.Writer`, a file format of ``gtpin export``;
- ``gtpin.presentations``: the ``Presentation`` of a result, under the name of the result's class;
- ``gtpin.options``: what an option of a command calls, under the option's name: ``history`` (``gtpin diagnose``) and
  ``commands`` (``gtpin export``).
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from gtpin.errors import GtpinError


def extensions(group: str) -> dict[str, Any]:
    """What is registered in a group, by name, in alphabetical order.

    Raises `GtpinError` if a part can't be loaded.
    """
    return {name: _loaded(point) for name, point in sorted(_points(group).items())}


def extension_names(group: str) -> tuple[str, ...]:
    """The names of a group, in alphabetical order; nothing is imported."""
    return tuple(sorted(_points(group)))


def extension(group: str, name: str) -> Any:
    """One part of a group.

    Raises `GtpinError` if there is none of this name, or it can't be loaded.
    """
    point = _points(group).get(name)
    if point is None:
        raise GtpinError(f"nothing is registered as {name} of {group}", hint="install gtpin again: it is not whole")
    return _loaded(point)


@cache  # a search of all installed packages
def _points(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=group)}


def _loaded(point: EntryPoint) -> Any:
    try:
        return point.load()
    except (ImportError, AttributeError) as error:
        what = f"{point.name} of {point.group} can't be loaded ({type(error).__name__}: {error})"
        raise GtpinError(what, hint=f"mend or remove {point.value}") from error
