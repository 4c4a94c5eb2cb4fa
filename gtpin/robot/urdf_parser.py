"""Pinocchio's URDF parser. What it writes to standard error becomes part of the error that is raised."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any

import pinocchio as pin

from gtpin.errors import RobotError


@contextmanager
def _standard_error_kept() -> Iterator[IO[bytes]]:
    """Catch what C++ code writes to standard error, so that the user gets one error message instead of several lines."""
    with tempfile.TemporaryFile() as kept:
        saved = os.dup(2)
        os.dup2(kept.fileno(), 2)
        try:
            yield kept
        finally:
            os.dup2(saved, 2)
            os.close(saved)


def build_model(xml: str, source: str) -> Any:
    """Build the Pinocchio model of a URDF's text.

    Raises
    ------
    RobotError
        If Pinocchio can't make a model of it; with the parser's message.
    """
    with _standard_error_kept() as kept:
        try:
            model, failure = pin.buildModelFromXML(xml), ""
        except (RuntimeError, ValueError) as error:
            model, failure = None, str(error)
        kept.seek(0)
        errors = re.findall(r"Error:\s*(.+)", kept.read().decode(errors="replace"))
    # The parser continues after some errors and leaves out what it could not read, for example the mass of a body.
    if model is None or errors:
        reason = errors[0].strip() if errors else failure
        raise RobotError(f"not a valid URDF ({reason})", file=source, hint="mend the URDF")
    return model
