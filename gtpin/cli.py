"""The command line: which commands there are, and how they fail."""

from __future__ import annotations

import os
import signal
import sys
import warnings
from typing import Annotated, Any

import typer

from gtpin import __version__
from gtpin.commands.blind import blind
from gtpin.commands.calibrate import calibrate
from gtpin.commands.compare import compare
from gtpin.commands.demo import demo
from gtpin.commands.diagnose import diagnose
from gtpin.commands.export import export
from gtpin.commands.predict import predict
from gtpin.commands.sensitivity import sensitivity
from gtpin.commands.simulate import simulate
from gtpin.commands.view import view
from gtpin.errors import ConvergenceError, GtpinError, GtpinWarning

INTERRUPTED = 130
"""Exit code after Ctrl-C, as shells have it."""

app = typer.Typer(
    name="gtpin",
    help="Closed-chain kinematics, calibration and diagnosis of the Gantry-Tau parallel robot and its kin.",
    no_args_is_help=True,
    epilog="Example: gtpin demo -o first-try",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for command, *examples in (
    (demo, "gtpin demo -o first-try"),
    (
        diagnose,
        "gtpin diagnose measurements -o diagnosis",
        "gtpin diagnose measurements -o second --exclude backlash --exclude linearity@cart2",
    ),
    (calibrate, "gtpin calibrate measurements -o calibrated", "gtpin calibrate measurements -o paper3 --model 3"),
    (compare, "gtpin compare measurements -o compared"),
    (
        predict,
        "gtpin predict diagnosis commands.csv -o predicted.csv",
        "gtpin predict gantry_tau commands.csv -o nominal.csv",
    ),
    (sensitivity, "gtpin sensitivity calibrated --poses commands.csv -o accuracy"),
    (export, "gtpin export calibrated -o robot.xml", "gtpin export diagnosis -o corrections.csv"),
    (
        simulate,
        "gtpin simulate -o virtual --poses 150 --seed 3",
        "gtpin simulate -o virtual --scenario examples/scenarios/backlash.toml",
    ),
    (view, "gtpin view gantry_tau", "gtpin view calibrated measurements -o gap.png"),
    (blind, "gtpin blind -o check --cases 100", "gtpin blind -o check --from cases"),
):
    app.command(epilog="\n\n".join(["Examples:" if examples[1:] else "Example:", *examples]))(command)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gtpin {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    pass


def _message(error: Exception) -> str:
    told = getattr(error, "format_message", None)
    return str(told() if told else error)


def _say(kind: str, text: Any) -> None:
    typer.echo(" ".join(f"gtpin: {kind}: {text}".split()), err=True)


def main() -> None:
    """Run the command line: exit 2 with one line on standard error for bad input, 1 where a solver did not converge."""
    kept: list[str] = []
    signal.signal(
        signal.SIGTERM, signal.default_int_handler
    )  # processes at work for this one end with it, as by Ctrl-C
    warnings.showwarning = lambda message, *_, **__: kept.append(str(message))
    warnings.simplefilter("ignore")
    warnings.simplefilter("always", GtpinWarning)
    code = _run()
    if code == 0:  # an error is one line, and what was noticed on the way to it is not the point
        for text in dict.fromkeys(kept):  # what two effects notice is said once
            _say("warning", text)
    sys.exit(code)


def _run() -> int:
    try:
        code = app(standalone_mode=False) or 0
        if code == INTERRUPTED:  # typer makes a code of the exception
            raise KeyboardInterrupt
        return code
    except typer.TyperException as error:  # wrong options, missing arguments
        if told := _message(error):  # without a command the help has been shown, and there is nothing to say
            _say("error", f"{told} (gtpin --help tells more)")
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
    except BrokenPipeError:
        return 0
    except MemoryError:
        _say("error", "there is too little memory: take fewer rows, or give it more (ulimit -v, a container's limit)")
        return 2
    except Exception as error:
        if os.environ.get("GTPIN_TRACEBACK"):
            raise
        _say("error", f"a fault of gtpin's own: {type(error).__name__}: {error} (GTPIN_TRACEBACK=1 shows where)")
        return 3
