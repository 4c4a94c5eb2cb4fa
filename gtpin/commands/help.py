"""The first help screen of a command has at most ten options; ``--help-all`` shows all."""

from __future__ import annotations

from typing import Any

from typer.core import TyperCommand, TyperOption

MOST = 10
"""Most options on a first help screen, ``--help`` among them."""
ALL = "--help-all"


class Command(TyperCommand):
    """A command whose first options, in the order of its function's parameters, are on the first help screen."""

    def __init__(self, *args: Any, params: list[Any], epilog: str | None = None, **more: Any) -> None:
        options = [param for param in params if isinstance(param, TyperOption) and not param.hidden]
        self._rare = options[MOST - 1 :]
        for option in self._rare:
            option.hidden = True
        if self._rare:
            epilog = f"More options: {ALL}\n\n{epilog or ''}"
        super().__init__(*args, params=params, epilog=epilog, **more)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of a call; ``--help-all`` among them is ``--help`` with all options."""
        if ALL in args:
            for option in self._rare:
                option.hidden = False
            args = ["--help"]
        return list(super().parse_args(ctx, args))
