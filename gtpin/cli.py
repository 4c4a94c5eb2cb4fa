"""The entry point of the command line: exit codes, error lines, Ctrl-C. The commands are imported after Ctrl-C is handled."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import warnings
from types import FrameType
from typing import TYPE_CHECKING, Any

from gtpin.errors import ConvergenceError, GtpinError, GtpinWarning, harmless

if TYPE_CHECKING:
    import typer

    app: typer.Typer

NOT_LOADED = "a library can't be loaded ({}); there may be too little memory, or it is not installed whole"
INTERRUPTED = 130
"""Exit code after Ctrl-C, as in shells: 128 + SIGINT."""
NOT_READ = 141
"""Exit code where the reader of a pipe ended (``gtpin ... | head -1``), as shells have it for other programs: 128 + SIGPIPE."""

ENDING = (signal.SIGINT, signal.SIGTERM, *(() if sys.platform == "win32" else (signal.SIGHUP,)))
"""Signals that end the program: Ctrl-C, a scheduler's end of time, a terminal that is closed."""


def __getattr__(name: str) -> Any:
    if name == "app":
        from gtpin.commands.registry import command_line

        return command_line()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def main() -> None:
    """Run the command line: exit 2 with one line on standard error for bad input, 1 where a solver did not converge."""
    _on_signals(_end_at_once)
    try:
        from gtpin.commands.registry import command_line

        app = command_line()
    except (ImportError, OSError, MemoryError) as error:  # a library that is broken, or that does not fit into memory
        _say("error", NOT_LOADED.format(error))
        sys.exit(2)

    # From now on these signals raise KeyboardInterrupt, so that worker processes are ended too.
    _on_signals(signal.default_int_handler)
    kept: list[str] = []
    warnings.showwarning = lambda message, *_, **__: kept.append(str(message))
    warnings.simplefilter("ignore")
    warnings.simplefilter("always", GtpinWarning)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal may not have all characters
    code = _flushed(_run(app))
    if code == 0:  # after an error only the error's line is shown, without warnings
        for text in dict.fromkeys(kept):  # the same warning from two effects is printed once
            _say("warning", text)
    sys.exit(code)


def _on_signals(handler: Any) -> None:
    for number in ENDING:
        if signal.getsignal(number) != signal.SIG_IGN:  # ignored signals stay ignored, as in the background of a shell
            signal.signal(number, handler)


def _end_at_once(number: int, frame: FrameType | None) -> None:
    """End the process at once: while modules are imported, an exception would look like an import error."""
    os.write(2, b"gtpin: error: interrupted\n")
    os._exit(INTERRUPTED)


def _run(app: typer.Typer) -> int:
    import typer

    try:
        code = app(standalone_mode=False) or 0
        if code == INTERRUPTED:  # typer turns the exception into this code
            raise KeyboardInterrupt
        return int(code)
    except typer.TyperException as error:  # wrong options, missing arguments
        if text := _message(error):  # without a command the help has been shown, and there is no message
            _say("error", f"{text} (see {_command(error)} --help)")
        return 2
    except ConvergenceError as error:
        _say("error", error)
        return 1
    except GtpinError as error:
        _say("error", error)
        return 2
    except (KeyboardInterrupt, typer.Abort):
        _say("error", "interrupted")
        return INTERRUPTED
    except (BrokenPipeError, SystemExit):  # where the pipe is closed, typer ends the process without a word
        return NOT_READ
    except ImportError as error:  # some libraries are loaded when they are needed
        _say("error", NOT_LOADED.format(error))
        return 2
    except MemoryError:
        _say("error", "there is too little memory: take fewer rows, or give it more (ulimit -v, a container's limit)")
        return 2
    except Exception as error:
        if os.environ.get("GTPIN_TRACEBACK"):
            raise
        if isinstance(error, OSError):  # for example an invalid path, or a port that is in use
            where = "" if error.filename is None else f"{error.filename}: "
            _say("error", f"{where}{error.strerror or error}")
            return 2
        _say("error", f"a fault of gtpin's own: {type(error).__name__}: {error} (GTPIN_TRACEBACK=1 shows where)")
        return 3


def _flushed(code: int) -> int:
    """Write the rest of standard output, and give the exit code. Other errors than a closed pipe were already reported."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as error:  # the rest is dropped, so that the interpreter does not try again when it ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.__stdout__.fileno() if sys.__stdout__ is not None else 1)
        if isinstance(error, BrokenPipeError):
            return code or NOT_READ
    return code


def _command(error: Exception) -> str:
    """The command that was called, as far as it was understood."""
    return str(getattr(getattr(error, "ctx", None), "command_path", "gtpin"))


def _message(error: Exception) -> str:
    message = getattr(error, "format_message", None)
    return str(message() if message else error)


def _say(kind: str, text: Any) -> None:
    with contextlib.suppress(OSError, AttributeError):  # standard error may be full, or closed
        sys.stderr.write(harmless(f"gtpin: {kind}: {text}") + "\n")
        sys.stderr.flush()
