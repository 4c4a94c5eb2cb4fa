"""How a command ended, and what is in a folder."""

from __future__ import annotations

import contextlib
import io
import sys
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

import gtpin.cli


@dataclass(frozen=True)
class Ran:
    """How a command ended."""

    code: int
    out: str
    err: str

    def failed(self, code: int = 2) -> str:
        """The error of a command that must have failed as the contract has it: exit code, one line, no traceback."""
        assert self.code == code, (self.code, self.out, self.err)
        errors = [line for line in self.err.splitlines() if not line.startswith("gtpin: warning: ")]
        assert len(errors) == 1, self.err
        assert errors[0].startswith("gtpin: error: ")
        assert "Traceback" not in self.err + self.out
        assert self.out == ""
        return errors[0]


def called(*arguments: object) -> Ran:
    """Run gtpin in this process."""
    out, err = io.StringIO(), io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        warnings.catch_warnings(),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        patch.setattr(sys, "argv", ["gtpin", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            gtpin.cli.main()
    return Ran(int(ended.value.code or 0), out.getvalue(), err.getvalue())


def refused(folder: Path, *arguments: object) -> str:
    """The error of a command that must fail, and leave the folder as it was."""
    before = everything(folder)
    error = called(*arguments).failed()
    assert everything(folder) == before
    return error


def everything(folder: Path) -> dict[str, bytes | None]:
    """All files under a folder with their bytes, and all folders with None."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }
