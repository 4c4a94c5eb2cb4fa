"""Robots by name: those that gtpin ships, then those of example-robot-data; any other by the path of its file."""

from __future__ import annotations

import difflib
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, TypeVar

import pinocchio as pin

from gtpin.errors import RobotError, listed, unheard, warn
from gtpin.references import is_path
from gtpin.robot.chain import Chain
from gtpin.robot.description import CONVERT, RobotDescription
from gtpin.robot.pinocchio_model import urdf_of
from gtpin.robot.resting import with_actuators, with_home

PACKAGE = "example-robot-data"

FILES: Mapping[str, str] = dict(
    row.split(",")
    for row in Path(__file__).with_name("example_robots.csv").read_text(encoding="utf-8").splitlines()[1:]
)
"""File of each loader, below the package's folder ``robots``. PyPI's package holds the files without the loaders' table."""

ARMS = ("kinova", "panda", "so100", "so101", "talos_left_arm", "ur10", "ur3", "ur5", "xarm7", "z1")
"""Loaders of single arms; variants of one arm, hands, legs and whole bodies are left out."""


@cache
def _examples_folder() -> Path | None:
    inside = Path("share", "example-robot-data", "robots")
    places = [Path(sys.prefix) / inside]  # conda
    try:
        distribution = metadata.distribution(PACKAGE)
        places.insert(0, Path(str(distribution.locate_file("cmeel.prefix"))) / inside)  # PyPI
    except metadata.PackageNotFoundError:
        pass
    return next((place for place in places if place.is_dir()), None)


def package_folder() -> Path | None:
    """The folder in which ``package://example-robot-data/`` paths start; None where the package is not installed."""
    folder = _examples_folder()
    return folder and folder.parents[1]


def example_names() -> tuple[str, ...]:
    """Names of the loaders whose files are there, sorted; none where the package is not installed."""
    folder = _examples_folder()
    return tuple(sorted(name for name, file in FILES.items() if folder is not None and (folder / file).is_file()))


def example_path(name: str) -> Path:
    """Path of the file of a loader that is there.

    Raises `RobotError` if the file is an SDF, which gtpin does not read.
    """
    folder = _examples_folder()
    assert folder is not None
    path = folder / FILES[name]
    if path.suffix == ".sdf":
        raise RobotError(f"{name} of {PACKAGE} is an SDF file", hint=CONVERT[".sdf"])
    return path


AnyRobot = TypeVar("AnyRobot", bound=Chain)


def _folder() -> Path:
    inside = Path(__file__).parents[1] / "urdf"  # in a wheel
    return inside if inside.is_dir() else Path(__file__).parents[2] / "urdf"  # in a checkout


def robot_names() -> tuple[str, ...]:
    """Names of the shipped robots, sorted.

    Examples
    --------
    >>> import gtpin
    >>> "gantry_tau" in gtpin.robot_names()
    True
    """
    return tuple(sorted(path.stem for path in _folder().glob("*.urdf")))


def urdf_path(name: str) -> Path:
    """Path of the file of a robot that has a name: a shipped one, or one of example-robot-data.

    Raises `RobotError` if no robot has that name, or its file is of a kind that gtpin does not read.
    """
    if name in robot_names():
        return _folder() / f"{name}.urdf"
    if name in example_names():
        return example_path(name)
    near = difflib.get_close_matches(name, [*robot_names(), *example_names()], n=1)
    known = f"use {', '.join(robot_names())}, one that gtpin robots lists, or the path of a URDF or MJCF file"
    raise RobotError(f"no robot is called {name!r}", hint=f"{f'did you mean {near[0]}? ' if near else ''}{known}")


def load_robot(
    robot: str | Path, tcp: str | None = None, actuators: Sequence[str] = (), home: Sequence[float] | str = ()
) -> Chain:
    """A robot without its kinematics: see :func:`gtpin.load_robot`."""
    return loaded(Chain, robot, tcp, actuators, home)


def loaded(
    kind: type[AnyRobot],
    robot: str | Path | pin.Model,
    tcp: str | None,
    actuators: Sequence[str],
    home: Sequence[float] | str,
    constraints: Sequence[Any] = (),
) -> AnyRobot:
    """A robot of a class, by its name or path, or from a model; notes on it are warnings."""
    named = home if isinstance(home, str) else ""
    if isinstance(robot, pin.Model):
        described = RobotDescription.parse(urdf_of(robot, constraints, named), "the pinocchio.Model")
    elif constraints:
        hint = "give them with a pinocchio.Model; a file has <loop_joint> elements"
        raise RobotError("constraints of a file", hint=hint)
    else:
        described = RobotDescription.read(robot_path(robot), named)
    described = with_actuators(described, actuators)
    if len(home) and not isinstance(home, str):
        with unheard():  # the robot itself warns
            near = kind(described, tcp).home_posture
        described = with_home(described, home, near)
    found = kind(described, tcp)
    for note in (*found.assembly.notes, *_without_effect(found)):
        warn(note)
    return found


def _without_effect(robot: Chain) -> Iterator[str]:
    """A note where actuators of a URDF without loops do not move the TCP."""
    model, leading = robot.model, {f.index_v: f.master_v for f in robot.followers}
    on_the_way = [int(model.idx_vs[joint]) for joint in model.supports[robot.tcp_joint] if joint]
    moving = {leading.get(v, v) for v in on_the_way}
    still = [actuator.joint for actuator in robot.actuators if actuator.index_v not in moving]
    if still and not robot.constraints and robot.description.kind == "urdf":
        yield (
            f"the TCP of {robot.name} ({robot.tcp_frame}) does not move with {listed(still)}: if the robot has a loop, add its "
            "<loop_joint>; if not, name the joints that are commanded (actuators = [...] in dataset.toml), or another TCP"
        )


def robot_path(robot: str | Path) -> Path:
    """Path of the file of a robot, by its name or by that path; see :func:`load_robot`."""
    text = str(robot)
    if isinstance(robot, Path) or is_path(text):
        return Path(text)
    named = text in robot_names() or text in example_names()
    return Path(text) if not named and os.path.isfile(text) else urdf_path(text)
