"""Lists of points or poses, as metrology programs export them: SpatialAnalyzer's ASCII points, and similar ones.

SpatialAnalyzer's user manual, "Exporting ASCII Formatted Points": a line for each point, ``Collection Group Target x y z`` or
fewer names, between spaces or commas, in the working frame and the working unit; comments after ``//``. Neither unit nor
order are in the file, so the user gives both.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from gtpin.data import Commands, Dataset, InstrumentSection
from gtpin.data.ids import Ids, normal_id, normal_ids
from gtpin.data.names import IDS, ORIENTATION, POSITION, is_command, known_lookalike, lookalike_words, lookalikes
from gtpin.data.table import Column, number
from gtpin.errors import DatasetError, warn
from gtpin.extras.importers.lines import decimal, text_lines
from gtpin.extras.importers.matched import Match, in_range, matched
from gtpin.robot.chain import Chain
from gtpin.robot.library import load_robot
from gtpin.typing import Floats

Separator = Literal["comma", "semicolon", "tab", "space"]
SIGNS: Mapping[Separator, str | None] = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None}
Length = Literal["m", "mm", "inch"]
LENGTHS: Mapping[Length, float] = {"m": 1.0, "mm": 1e-3, "inch": 0.0254}
Angle = Literal["rad", "deg"]
ANGLES: Mapping[Angle, float] = {"rad": 1.0, "deg": np.pi / 180.0}

TURNS = ("rx", "ry", "rz")
"""Names of the three columns of a rotation."""
Rotations = Literal[
    "vector", "xyz", "xzy", "yxz", "yzx", "zxy", "zyx", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "ZXZ", "ZYZ"
]
"""A rotation vector, or the axes of Euler angles in the order of the columns: fixed ones (small letters), or moving ones."""


@dataclass(frozen=True)
class Preset:
    """How poses are written: names of the columns, separator, units, and what rx, ry and rz are; empty where it is open."""

    columns: tuple[str, ...] = ()
    separator: Separator | None = None
    unit: Length | None = None
    angle: Angle | None = None
    rotations: Rotations | None = None


PresetName = Literal["abb", "fanuc", "kuka", "spatialanalyzer", "ur"]
_TURNED, _QUATERNIONS = ("pose", *POSITION, *TURNS), ("pose", *POSITION, *ORIENTATION)
PRESETS: Mapping[PresetName, Preset] = {
    "abb": Preset(_QUATERNIONS, "comma", "mm"),
    "fanuc": Preset(_TURNED, "comma", "mm", "deg", "xyz"),
    "kuka": Preset(_TURNED, "comma", "mm", "deg", "ZYX"),
    "spatialanalyzer": Preset(("-", "-", "pose", *POSITION), "space", "mm"),
    "ur": Preset(_TURNED, "comma", "m", "rad", "vector"),
}
"""Source: "Pose formats" in the documentation of Basler's rc_visard. ABB: q1 .. q4, the scalar first. FANUC: W, P, R about the
fixed axes x, y, z. KUKA: A, B, C about the moving axes z, y, x. Universal Robots: a rotation vector; its scripts use m, its
pendant shows mm."""
IGNORED = "-"
NEAR = 0.7
"""Least share of letters that a name has in common with one of four letters or fewer that may be meant. Assumed."""
MOST_TURNS = 3
"""Number of turns beyond which commands without a unit look like degrees. Assumed: joints of arms turn once or twice."""
COMMENTS = ("//", "#", "%")
"""Beginnings of comment lines: // in SpatialAnalyzer's exports, the others in files of other programs."""


@dataclass(frozen=True, eq=False)
class NamedColumns:
    """The content of a table.

    ``file``, ``row``: the file, and the (N,) line of each row. ``pose``: (N,) ids; None where there is no such column.
    ``values``: (N,) numbers of the other columns by name, in the units of the file; of ``session`` ids.
    """

    file: Path
    row: npt.NDArray[np.int64]
    pose: Ids | None
    values: Mapping[str, Column]

    def with_quaternions(self, rotations: Rotations | None, angle: Angle | None) -> NamedColumns:
        """The same with quaternions in place of rx, ry and rz, if it has these.

        Raises `DatasetError` if their meaning or their unit is not given.
        """
        if TURNS[0] not in self.values:
            return self
        if rotations is None or angle is None:
            hint = "add --angle, and --rotation vector or the axes of the angles: zyx about fixed axes, ZYX about moving ones"
            raise DatasetError("it is not said what rx, ry and rz are", file=self.file, column="rx", hint=hint)
        turns = self.matrix(TURNS) * ANGLES[angle]
        turned = Rotation.from_rotvec(turns) if rotations == "vector" else Rotation.from_euler(rotations, turns)
        own = dict(zip(ORIENTATION, turned.as_quat(scalar_first=True).T, strict=True))
        return replace(self, values={name: v for name, v in self.values.items() if name not in TURNS} | own)

    def take(self, rows: npt.NDArray[np.bool_]) -> NamedColumns:
        """Some of the rows."""
        pose = None if self.pose is None else self.pose[rows]
        return NamedColumns(self.file, self.row[rows], pose, {name: v[rows] for name, v in self.values.items()})

    def matrix(self, names: Sequence[str]) -> Floats:
        """(N, len(names)) several columns."""
        return np.column_stack([self.values[name] for name in names])

    def commands(self, names: Sequence[str], scale: Floats) -> Commands:
        """The commands in the table, in m or rad by their scales; rows without an id are numbered."""
        pose = normal_ids(range(1, len(self.row) + 1)) if self.pose is None else self.pose
        return Commands(pose, self.matrix(names) * scale, row=self.row, file=self.file)

    def dataset(
        self,
        robot: str,
        commands: Commands,
        at: npt.NDArray[np.intp],
        *,
        metres: float = 1.0,
        instrument: InstrumentSection | None,
        tcp: str | None,
    ) -> Dataset:
        """The dataset of the poses in the table, which have the commands with the indices ``at`` (N,); without rows of -1.

        ``metres``: the unit of x, y and z. Raises `DatasetError` for a command that is far outside the robot's range.
        """
        if (at < 0).any():
            return self.take(at >= 0).dataset(
                robot, commands, at[at >= 0], metres=metres, instrument=instrument, tcp=tcp
            )
        commands = in_range(commands, load_robot(robot, tcp))
        own = {n: v for n, v in self.values.items() if n not in (*POSITION, *ORIENTATION) and not is_command(n)}
        return Dataset(
            robot=robot,
            pose=commands.pose[at],
            q=commands.q[at],
            position=self.matrix(POSITION) * metres,
            orientation=self.matrix(ORIENTATION) if ORIENTATION[0] in self.values else None,
            covariates={name: values[at] for name, values in commands.covariates.items()} | own,
            instrument=instrument or instrument_of(robot, tcp),
            tcp=tcp,
            row=self.row,
            file=self.file,
        )


def read_named_columns(
    file: Path,
    names: list[str],
    separator: Separator,
    *,
    header: int = 0,
    decimal_comma: bool = False,
    needed: Sequence[str] = POSITION,
) -> NamedColumns:
    """Read a table.

    ``file``: a text file; blank lines, lines that begin with ``//``, ``#`` or ``%``, and lines without a number before the
    first row are ignored. ``names``: names of the columns in their order: ``pose``, ``x y z``, ``qw qx qy qz`` or ``rx ry rz``,
    ``q1 .. qn``, ``session``, names of covariates, and ``-`` for one that is ignored. ``separator``: of columns: ``comma``,
    ``semicolon``, ``tab`` or ``space`` (any number of them). ``header``: number of lines at the beginning that are not rows.
    ``decimal_comma``: whether the decimal separator is a comma. ``needed``: names that must be there.

    Raises `DatasetError` if a name is missing or there twice, the names in the file are in another order, or a row has
    another number of columns, or text where a number must be. Warns of rows without a position, which are left out.
    """
    wanted = _wanted(names, separator, decimal_comma, needed)
    rows: list[int] = []
    ids: dict[str, list[str]] = {name: [] for name in wanted if name in IDS}
    cells: dict[str, list[float]] = {name: [] for name in wanted if name not in IDS}
    lost: list[int] = []  # as an instrument writes them that does not see its target
    for row, line in enumerate(text_lines(file), 1):
        if row <= header or not line.strip() or line.lstrip().startswith(COMMENTS):
            continue
        texts = [text.strip() for text in line.split(SIGNS[separator])]
        words = texts if len(texts) == len(names) else re.split(r"[\s,;]+", line)
        if not rows and all(math.isnan(number(word.replace(",", ".", 1))) for word in words):
            if words is texts:
                _check_header(texts, wanted, file, row)
            continue
        if (
            len(texts) > 1
            and POSITION[0] in wanted
            and not any("".join(texts[wanted[name] : wanted[name] + 1]) for name in POSITION)
        ):
            lost.append(row)
            continue
        if len(texts) != len(names):
            what = f"the row has {len(texts)} columns, and {len(names)} are named"
            hint = f"name all columns in their order, '{IGNORED}' for those that are not wanted; the separator is a {separator}"
            raise DatasetError(what, file=file, row=row, hint=hint)
        for name, place in wanted.items():
            text = texts[place]
            if name in ids:
                try:
                    ids[name].append(normal_id(text))
                except ValueError as error:
                    raise DatasetError(
                        str(error), file=file, row=row, column=name, hint=f"give every row a {name}"
                    ) from None
            else:
                plain = text.replace(",", ".", 1) if decimal_comma else text
                hint = "if this line is no row, pass over it (--header N); else correct it"
                if not rows and (known := known_lookalike(name) or next(iter(_near(name)), None)):
                    hint = f"did you mean the column {known} in --columns?"
                elif "," in plain and not np.isnan(number(plain.replace(",", ".", 1))):
                    hint = "if numbers have a comma for the point, give --decimal-comma"
                elif rows:
                    hint = "correct the row, or delete it"
                cells[name].append(decimal(plain, file, row, name, hint))
        rows.append(row)
    if not rows:
        raise DatasetError("there are no rows", file=file, hint="check the number of header lines (--header)")
    if lost:
        warn(f"{file}: {len(lost):,} rows have no position (the first is row {lost[0]}): they are left out")
    values: dict[str, Column] = {name: np.array(v) for name, v in cells.items()}
    named = {name: np.array(v, dtype=object) for name, v in ids.items()}
    pose = named.pop("pose", None)
    return NamedColumns(file, np.array(rows, dtype=np.int64), pose, {**values, **named})


def _check_header(texts: list[str], wanted: Mapping[str, int], file: Path, row: int) -> None:
    """Raise `DatasetError` where a column has the name of another wanted one, and no other column has it."""
    header = [re.sub(r"[\s\[(].*", "", text.lower().strip("\"'")) for text in texts]
    for name, place in wanted.items():
        own = header[place]
        if own != name and own in wanted and header.count(own) == 1:
            what = f"column {place + 1} is {own!r} here, and {name!r} in --columns"
            hint = "name the columns in their order, or pass over this line (--header N) if it is wrong"
            raise DatasetError(what, file=file, row=row, column=name, hint=hint)


def _wanted(names: list[str], separator: Separator, decimal_comma: bool, needed: Sequence[str]) -> dict[str, int]:
    """Index, from 0, of each column that is used, by its name."""
    found: dict[str, int] = {}
    for place, name in enumerate(names):
        if name == IGNORED:
            continue
        if not name or name in found:
            what = f"the column {name} is named twice" if name else "a column without a name"
            raise DatasetError(what, hint=f"in --columns name each once, and '{IGNORED}' what is not wanted")
        found[name] = place
    missing = [name for name in needed if name not in found]
    turned = [name for name in ORIENTATION if name in found]
    missing += [name for name in ORIENTATION if turned and name not in found]
    angles = [name for name in TURNS if name in found]
    missing += [name for name in TURNS if angles and name not in found]
    if turned and angles:
        what = "both quaternions and angles are named"
        raise DatasetError(what, hint=f"in --columns name one, and '{IGNORED}' the other")
    if missing:
        hint = "in --columns name x, y, z, and all or none of qw, qx, qy, qz, or of rx, ry, rz"
        raise DatasetError(f"no column is named {missing[0]}", hint=hint)
    if separator not in SIGNS:
        raise DatasetError(f"the separator {separator!r} is not known", hint=", ".join(SIGNS))
    if decimal_comma and separator == "comma":
        what = "commas between columns and in numbers"
        raise DatasetError(what, hint="name the other separator (--separator), or export with a decimal point")
    covariates = [
        name for name in found if name not in (*IDS, *POSITION, *ORIENTATION, *TURNS) and not is_command(name)
    ]
    like = {name: known for name in covariates for known in _near(name) if known not in found}
    if alike := lookalikes(covariates) | like:
        warn(f"--columns: {lookalike_words(alike)}")
    return found


def _near(name: str) -> list[str]:
    """The short name of a column that a name nearly equals, or none."""
    known = ("pose", "time", *ORIENTATION, *TURNS)
    return [] if name in known else get_close_matches(name.lower(), known, 1, NEAR)


def instrument_of(
    robot: str,
    tcp: str | None,
    frame: Literal["free", "robot"] = "free",
    target: Literal["free", "tcp"] | None = None,
    sigma: float | None = None,
    stations: Literal["session"] | None = None,
) -> InstrumentSection:
    """The tracker of a list of points. By default its frame and its target are free; of a robot with rods the target is the
    TCP, because the joints on the platform are identified with it. ``sigma``: of a position, per axis, m; None: unknown.
    ``stations``: the column with a value for each place where the instrument stood; None: it stood in one place.

    Raises `DatasetError` if ``sigma`` is no positive number of metres.
    """
    if sigma is not None and not 0.0 < sigma < math.inf:
        raise DatasetError(f"a sigma of {sigma:g} m", hint="give a positive number of metres (--sigma)")
    at = target or ("tcp" if load_robot(robot, tcp).rods else "free")
    return InstrumentSection(frame=frame, target=at, position_sigma=sigma, stations=stations)


def commands_among(names: Iterable[str]) -> list[str]:
    """Which columns are commands, q1 .. qn in order; raises `DatasetError` for a gap."""
    found = sorted((name for name in names if is_command(name)), key=lambda name: int(name[1:]))
    for place, name in enumerate(found, 1):
        if name != f"q{place}":
            raise DatasetError(f"no column is named q{place}", hint="in --columns name q1 .. qn without a gap")
    return found


def read_commands(
    file: Path | str,
    robot: str,
    unit: Length,
    *,
    angle: Angle | None = None,
    decimal_comma: bool = False,
    tcp: str | None = None,
) -> Commands:
    """Read the commands of a list of points: gtpin's own table, or joint values as a controller logs them.

    ``file``: a table with the columns ``pose, q1 .. qn``, in m, and in rad unless ``angle`` is ``deg``, where ``time`` may
    stand in place of ``pose``; or, under any names, a column of poses or none, and one for each actuator, in order, between
    semicolons, tabs or commas. Their units are ``unit`` and ``angle``, and ``decimal_comma`` is as in
    :func:`~gtpin.extras.importers.points.read_named_columns`.

    Raises `GtpinError` if a row is damaged, the number of columns is another, or a unit is not given.
    """
    file, machine = Path(file), load_robot(robot, tcp)
    revolute = machine.revolute
    said = (line for line in text_lines(file) if line.strip() and not line.lstrip().startswith(COMMENTS))
    head = "q1" if file.suffix.lower() == ".parquet" else next(said, "")
    if "q1" in (name.strip() for name in head.split(",")):
        found = Commands.read(file, len(revolute), numbered=True)
        turned = np.abs(found.q[:, revolute]).max(initial=0.0)
        if angle is None and turned > MOST_TURNS * 2.0 * np.pi:
            raise DatasetError(
                "commands of joints that turn look like degrees", file=file, hint="add --angle deg, or rad"
            )
        if angle == "deg" and 0.0 < turned <= 2.0 * np.pi:
            what = f"commands of joints that turn are at most {turned:.3g}, and look like radians"
            raise DatasetError(what, file=file, hint="leave out --angle deg")
        return replace(found, q=found.q * np.where(revolute, ANGLES[angle or "rad"], 1.0))
    separator: Separator = "semicolon" if ";" in head else "tab" if "\t" in head else "comma"
    commands = [f"q{i}" for i in range(1, len(revolute) + 1)]
    count = len(head.split(SIGNS[separator]))
    if count not in (len(commands), len(commands) + 1):
        what = f"the table has {count} columns, and {robot} has {len(commands)} actuators"
        raise DatasetError(
            what, file=file, row=1, hint="give pose, q1 .. qn, or one column for each, after one of poses or none"
        )
    names = ["pose", *commands][-count:]
    table = read_named_columns(file, names, separator, decimal_comma=decimal_comma, needed=commands)
    return table.commands(commands, _scale(machine, len(commands), unit, angle))


def read_points(
    file: Path | str,
    robot: str,
    columns: list[str],
    separator: Separator,
    unit: Length,
    *,
    angle: Angle | None = None,
    commands: Commands | None = None,
    match: Match | None = None,
    within: float | None = None,
    header: int = 0,
    decimal_comma: bool = False,
    rotations: Rotations | None = None,
    instrument: InstrumentSection | None = None,
    tcp: str | None = None,
) -> Dataset:
    """Read a list of points or poses.

    ``file``: the list. ``robot``, ``tcp``: as in dataset.toml. ``columns``, ``separator``, ``header``, ``decimal_comma``:
    see :func:`read_named_columns`. ``unit``: unit of x, y and z, and of the commands of actuators
    that slide, where the list has them. ``angle``: unit of the commands of actuators that turn, and of rx, ry and rz, where
    the list has them. ``rotations``: what rx, ry and rz are: ``vector``, or the axes of Euler angles in the order of the
    columns, about fixed axes (``zyx``) or moving ones (``ZYX``), as in SciPy.
    ``commands``, ``match``, ``within``: the commands, where the list has none, and how they are matched with its rows: see
    :func:`~gtpin.extras.importers.matched.matched`. ``instrument``: the instrument; by default :func:`instrument_of`, with
    unknown noise.

    Raises `GtpinError` if a row is damaged, or columns or units are not given completely.
    """
    file = Path(file)
    if unit not in LENGTHS:
        raise DatasetError(f"the unit {unit!r} is not known", hint=f"one of {', '.join(LENGTHS)}")
    own = commands_among(columns)
    if bool(own) == (commands is not None):
        what = "commands both in the list and in a table" if own else "there are no commands"
        hint = "name the columns q1 .. qn (--columns), or give a table of commands (--commands), and not both"
        raise DatasetError(what, file=file, hint=hint)
    if commands is not None and match is None:
        hint = "give --match pose|row|time"
        raise DatasetError("it is not said which command belongs to which row", file=file, hint=hint)
    table = read_named_columns(file, columns, separator, header=header, decimal_comma=decimal_comma)
    table = table.with_quaternions(rotations, angle)
    if commands is None:
        commands = table.commands(own, _scale(load_robot(robot, tcp), len(own), unit, angle))
        at = np.arange(len(table.row))
    else:
        assert match is not None
        time = table.values.get("time")
        at = matched(commands, match, file=file, row=table.row, pose=table.pose, time=time, within=within)
    return table.dataset(robot, commands, at, metres=LENGTHS[unit], instrument=instrument, tcp=tcp)


def _scale(robot: Chain, count: int, unit: Length, angle: Angle | None) -> np.ndarray:
    """(n,) factor from the unit of each command to m or rad."""
    revolute = robot.revolute
    if len(revolute) != count:
        what = f"{count} columns of commands for the {len(revolute)} actuators of {robot.name}"
        raise DatasetError(what, hint="in --columns name one for each, q1 .. qn")
    if revolute.any() and angle not in ANGLES:
        what = f"joints of {robot.name} turn, and the unit of their commands is not given"
        raise DatasetError(what, hint=f"add {' or '.join(f'--angle {name}' for name in ANGLES)}")
    return np.where(revolute, ANGLES[angle] if angle is not None else np.nan, LENGTHS[unit])
