"""Common parts of all commands: options, progress, and the output of results."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import typer
from rich.console import Console, RenderableType
from rich.progress import Progress as RichProgress
from rich.progress import SpinnerColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
from typer.core import TyperCommand, TyperOption

from gtpin.calibration.robust_fit import EXPECTED, Progress
from gtpin.data import Dataset
from gtpin.errors import GtpinError
from gtpin.output.results import json_text, results_folder
from gtpin.output.shown import present
from gtpin.threads import one_thread


def _output_path(text: str) -> Path:
    if not text:  # as from an unset variable of a script
        raise typer.BadParameter("it is empty")
    return Path(text)


def output_option(text: str, *, show_default: bool = False) -> Any:
    """The option ``-o`` with the help ``text``; an empty path is an error."""
    return typer.Option("-o", "--output", help=text, show_default=show_default, parser=_output_path, metavar="<path>")


Output = Annotated[Path, output_option("Folder for the results; created.")]
Force = Annotated[
    bool, typer.Option("--force", help="Move what gtpin has not written, or was changed since, aside (NAME.old-1).")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Seed = Annotated[int, typer.Option("--seed", help="Makes every random step repeatable.", min=0)]
CartOrientation = Annotated[
    bool, typer.Option("--cart-orientation", help="Measured tracks: interpolate the measured cart orientation too.")
]
DatasetFolder = Annotated[Path, typer.Argument(help="Folder that holds dataset.toml and poses.csv.")]
ModelReference = Annotated[
    str,
    typer.Argument(
        help="Folder of a model, name of a robot (gtpin robots lists them), or path of a URDF or MJCF file."
    ),
]
Tcp = Annotated[
    str | None, typer.Option("--tcp", metavar="LINK", help="The link that is the TCP, where it is not the robot's own.")
]
Actuators = Annotated[
    str,
    typer.Option("--actuators", metavar="JOINT,JOINT", help="The joints that q1 .. qn command, where not the file's."),
]
Home = Annotated[
    str,
    typer.Option(
        "--home", metavar="Q1,Q2", help="Commands of the posture that chooses the assembly, or the name of a keyframe."
    ),
]


def chosen(actuators: str, home: str) -> dict[str, Any]:
    """The arguments of `read_model` for these options: names of joints, and commands or the name of a keyframe."""
    words = home.replace(",", " ").split()
    try:
        commands: str | tuple[float, ...] = tuple(float(word) for word in words)
    except ValueError:
        commands = home
    return {"actuators": tuple(actuators.replace(",", " ").split()), "home": commands}


TrustData = Annotated[
    bool, typer.Option("--trust-data", help="Checks for usual mistakes in the data only warn, and never refuse them.")
]
FewerPoses = Annotated[
    int | None,
    typer.Option(
        "--poses", metavar="N", min=1, help="Use N of very many poses: a half at random, and the most telling."
    ),
]

Vector = tuple[float, float, float]
Origin = Annotated[
    Vector, typer.Option("--origin", metavar="X Y Z", help="The controller's zero in the robot's base frame, m.")
]
ZERO: Vector = (0.0, 0.0, 0.0)

MOST = 10
"""Most options on the first help screen of a command, ``--help`` among them; ``--help-all`` shows all."""
ALL = "--help-all"
PIPED_WIDTH = 120
"""Width of tables, in characters, where the output is not a terminal."""


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

    def invoke(self, ctx: Any) -> Any:
        """Run the command, its linear algebra in one thread."""
        with one_thread():
            return super().invoke(ctx)


def read_dataset(folder: Path, tcp: str | None = None, *, trust: bool = False) -> Dataset:
    """The dataset of a folder, with the TCP and the trust of the command line."""
    found = replace(Dataset.read(folder), trusted=trust)
    return found if tcp is None else replace(found, tcp=tcp)


def write_json(file: Path, content: object) -> None:
    """Write a result as JSON, with as many digits as needed to read back the same numbers."""
    file.write_text(json_text(content), encoding="utf-8")


def not_its_input(output: Path, read: Path) -> None:
    """Raise an error if the file ``output`` is the input file ``read``."""
    if os.path.exists(output) and os.path.exists(read) and os.path.samefile(output, read):
        raise GtpinError("this is read", file=output, hint="name another file for the result")


def tell(result: object, text: str, as_json: bool) -> None:
    """Print a result on standard output: the text, or only the JSON."""
    try:
        typer.echo(json_text(result).rstrip("\n") if as_json else text.rstrip("\n"))
    except BrokenPipeError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise GtpinError(f"standard output can't be written ({reason})", hint="what -o names is written") from None


def rendered(*parts: RenderableType) -> str:
    """Tables and sentences as text: on a terminal in colour and as wide as it, else without colour, `PIPED_WIDTH` wide."""
    console = Console(highlight=False, markup=False)
    if not console.is_terminal:
        console = Console(highlight=False, markup=False, width=PIPED_WIDTH, soft_wrap=True)
    with console.capture() as captured:
        for part in parts:
            console.print(part)
    return "\n".join(line.rstrip(" ") for line in captured.get().splitlines())


@contextmanager
def result_in(output: Path, files: Collection[str], *, force: bool, as_json: bool) -> Iterator[Callable[[Any], None]]:
    """Context of a command that writes one result into a folder; it yields the function that takes the result.

    The result is written at once. When the block ends without an error it is moved into place, and printed.

    ``files``: names of all that the result's presentation writes.
    """
    with results_folder(output, files, force=force) as folder:
        taken: list[tuple[Any, object]] = []

        def take(found: Any) -> None:
            shown = present(found)
            taken.append((shown, shown.write(folder)))

        yield take
        there = [name for name in files if (folder / name).exists()]
    (shown, content), page = taken[0], next((name for name in files if name.endswith(".html")), "")
    names = f"Written: {', '.join(str(output / name) for name in there)}"
    text = rendered(shown.terminal(output), f"{names}\nOpen {output / page}" if page else names)
    tell(content, text, as_json)


DONE = {
    "rough fit": 0.02,
    "fit": 0.05,
    "searching for causes": 0.1,
    "comparing causes": 0.5,
    "fitting causes and geometry together": 0.85,
    "predicting poses left out": 0.9,
    "what to measure next": 0.95,
}
"""Share of a diagnosis's time that is over when a step of it begins. Measured: arms of 200 to 440 poses."""


@contextmanager
def progress_of(what: str, done: Mapping[str, float] = MappingProxyType({})) -> Iterator[Progress]:
    """Show progress of long work on standard error, if that is a terminal; yields the function to report it to.

    What is expected of the work is told on a line of its own, on a terminal or not. ``done``: by name of a step, without its
    number, the share of the work that is over when it begins.
    """
    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn("{task.description}"), TaskProgressColumn(), TimeElapsedColumn())
    with RichProgress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=1.0 if done else None)

        def report(step: str, iteration: int, size: float) -> None:
            if step.startswith(EXPECTED):
                typer.echo(f"gtpin: {what}, {step}", err=True)
                return
            detail = f", iteration {iteration}, residuals {size:.3g} times the noise" if iteration else ""
            over = done.get(step.rstrip("0123456789 "), 0.0)
            bar.update(task, description=f"{what}: {step}{detail}", completed=max(over, bar.tasks[0].completed))

        yield report
