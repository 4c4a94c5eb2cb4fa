"""Instruments of a dataset of schema 2: what each ``[[instrument]]`` of dataset.toml may say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, StringConstraints, ValidationError, field_validator, model_validator

from gtpin.data.description import (
    LARGEST,
    SCHEMA,
    SIZE,
    Description,
    Frame,
    Point,
    Positive,
    SigmaValue,
    Station,
    Stations,
    Text,
    TomlSection,
    describe,
    explained,
    hint,
    meant,
    mistake,
    with_free_frames,
)
from gtpin.errors import DatasetError
from gtpin.typing import Floats

NotNegative = Annotated[float, Field(ge=0.0, le=LARGEST, allow_inf_nan=False)]
Sigma = Annotated[SigmaValue | None, hint(f"1 sigma of its reading, m or rad, {SIZE}")]
NAME = r"[A-Za-z0-9_-]+"
"""Pattern of an instrument's name."""
RESERVED = ("carts", "commands", "truth")
"""Names of tables of a dataset's folder that are no instrument's."""
NAME_HINT = "letters, digits, - and _: it is part of parameters' names"
Name = Annotated[str, StringConstraints(pattern=f"^{NAME}$"), hint(NAME_HINT)]
Distance = Annotated[tuple[Text, Text, Positive, Positive], Field(strict=False)]
EXACT = 1e-9
"""Standard deviation, m and rad, of a declared place that is exact."""
_TARGET = hint("target = [x, y, z], three finite numbers in m, TCP frame")
_DISTANCES = 'distances = [["S1", "S2", 0.05, 5e-5]]: two sockets, m, and 1 sigma'


def shows_place(sigma: float, motions: Floats) -> Floats:
    """(6, 6) information on motions of the machine from places that are declared with a standard deviation, m or rad.

    ``motions``: (..., 6) displacement of each place relative to the machine by three shifts, m, and three rotations, rad, of
    the machine about the base's origin.
    """
    rows = motions.reshape(-1, 6)
    return np.asarray(rows.T @ rows / max(sigma, EXACT) ** 2)


def _points_by_place(points: Iterable[Point]) -> Floats:
    """(N, 3, 6) displacements of points (3,), m, base frame, for :func:`shows_place`."""
    return np.array([np.hstack([np.eye(3), -np.cross(np.eye(3), p).T]) for p in points]).reshape(-1, 3, 6)


def _tilts(normal: Floats) -> Floats:
    """(3, 6) tilts of a unit vector (3,), for :func:`shows_place`."""
    return np.hstack([np.zeros((3, 3)), -np.cross(np.eye(3), normal).T])


class InstrumentTable(TomlSection):
    """The keys of an ``[[instrument]]`` section of dataset.toml; the class of your own kind of instrument derives from it.

    - ``name``: the instrument's name, of letters, digits, ``_`` and ``-``.
    - ``kind``: the kind of instrument (``range``, ``plane``, ...).
    - ``file``: its table of rows in the dataset's folder; None for NAME.csv or NAME.parquet.
    - ``sigma``: standard deviation of a reading, per axis, m or rad; None where it is to be estimated.
    - ``target``: (3,) the observed point of the platform, TCP frame, m; None for the TCP.
    - ``targets``: several such points, by the ids in the column ``target``; empty where there is one.
    - ``target_sigma``: standard deviation of the priors of the targets' coordinates, m; 0 where they are exact.

    Examples
    --------
    >>> from typing import ClassVar, Literal
    >>> import gtpin
    >>> class StringTable(gtpin.InstrumentTable):
    ...     numbers: ClassVar = ("reading",)
    ...     kind: Literal["string"]
    ...     length_sigma: float = 1e-2
    >>> StringTable(name="left", kind="string", sigma=2e-5).length_sigma
    0.01
    """

    numbers: ClassVar[tuple[str, ...]] = ()
    """Columns of numbers that the table must have."""
    optional: ClassVar[tuple[str, ...]] = ()
    """Columns of numbers that it may have."""
    ids: ClassVar[tuple[str, ...]] = ()
    """Columns of ids that it may have."""
    needed: ClassVar[tuple[str, ...]] = ()
    """Columns of ids that it must have."""

    name: Name
    kind: Text
    file: Text | None = None
    sigma: Sigma = None
    target: Annotated[Point | None, _TARGET] = None
    targets: Annotated[dict[Text, Point], hint("targets = {A = [x, y, z], B = [x, y, z]}, m, TCP frame")] = Field({})
    target_sigma: NotNegative = 0.0
    targetless: ClassVar[str] = ""
    """What it is called in the error that it has no target; empty where it has one."""

    @model_validator(mode="after")
    def _has_one_kind_of_target(self) -> Self:
        if self.targetless and (self.target is not None or self.targets):
            key = "targets" if self.targets else "target"
            raise mistake(key, f"{self.targetless} has no target", "leave it out")
        if self.target is not None and self.targets:
            raise mistake("targets", "target and targets", "write one of the two")
        return self

    @property
    def fixed_targets(self) -> dict[str, tuple[float, float, float]]:
        """Targets by id, (3,) each, TCP frame, m; a single target has the id ``""``."""
        return self.targets or {"": self.target if isinstance(self.target, tuple) else (0.0, 0.0, 0.0)}

    @property
    def measured_joints(self) -> tuple[str, ...]:
        """Names in the URDF of the passive joints whose coordinates it reads; none by default."""
        return ()

    @property
    def measured_links(self) -> tuple[str, ...]:
        """Names of the links, beside the platform, whose rotations it reads; none by default."""
        return ()

    def place_information(self, up: Floats) -> Floats:
        """(6, 6) information of its declared place on three shifts of the machine, m, and three rotations, rad, about the
        base's origin: what its readings would show if they had no noise. By default, all six exactly. ``up``: (3,) unit
        vector against gravity, base frame."""
        return shows_place(0.0, np.eye(6))


class TrackerTable(InstrumentTable):
    """A laser tracker, a camera, or motion capture: positions, and orientations where it reads them.

    - ``target``: also ``tcp``, or ``free`` where the target's pose on the platform is identified.
    - ``position_sigma``, ``orientation_sigma``: standard deviations per axis, m and rad; None where they are to be estimated.
    - ``frame``: ``robot`` where its frame is the base frame, ``free`` where the pose of the base frame in it is identified.
    - ``station``: (3,) the instrument's own position in its frame, m; None where it is not known.
    - ``stations``: ``session`` where it has a free frame for each value of this column.
    """

    numbers: ClassVar[tuple[str, ...]] = ("x", "y", "z")
    optional: ClassVar[tuple[str, ...]] = ("qw", "qx", "qy", "qz", "sx", "sy", "sz", "srx", "sry", "srz")
    ids: ClassVar[tuple[str, ...]] = ("target",)

    kind: Literal["tracker"]
    target: Annotated[Point | Literal["free", "tcp"] | None, _TARGET] = None  # type: ignore[assignment]
    position_sigma: Sigma = None
    orientation_sigma: Sigma = None
    frame: Frame = "robot"
    station: Station | None = None
    stations: Stations = None
    _free_frames = model_validator(mode="before")(with_free_frames)

    @model_validator(mode="after")
    def _has_one_sigma_of_positions(self) -> Self:
        if self.sigma is not None and self.position_sigma is not None:
            raise mistake("sigma", "sigma and position_sigma", "write one of the two: they are the same")
        return self

    def place_information(self, up: Floats) -> Floats:
        """None of a free frame."""
        return super().place_information(up) * (self.frame == "robot")


class RangeTable(InstrumentTable):
    """Distances from stations: a ball bar, a draw wire, a laser tracer.

    - ``stations``: nominal centres by id, (3,) each, base frame, m.
    - ``station_sigma``, ``offset_sigma``: standard deviations of the priors of each coordinate of a centre, and of the offset
      that is added to all its ranges, m; 0 where they are exact.
    """

    numbers: ClassVar[tuple[str, ...]] = ("range",)
    ids: ClassVar[tuple[str, ...]] = ("station", "target")

    kind: Literal["range"]
    stations: Annotated[
        dict[Text, Point], hint("stations = {A = [x, y, z]}, m, base frame: where each stands, roughly")
    ] = Field(min_length=1)
    station_sigma: NotNegative = 0.5
    offset_sigma: NotNegative = 0.0

    def place_information(self, up: Floats) -> Floats:
        """That of its stations."""
        return shows_place(self.station_sigma, _points_by_place(self.stations.values()))


class PlaneOf(TomlSection):
    """A plane: a point on it, m, and its normal, base frame."""

    point: Point
    normal: Point

    @field_validator("normal")
    @classmethod
    def _is_a_direction(cls, value: tuple[float, float, float]) -> tuple[float, float, float]:
        if sum(v * v for v in value) < 1e-12:
            raise ValueError("a normal needs a length")
        return value


class PlaneTable(InstrumentTable):
    """Touches of planes: a probe, a bed mesh, a dial gauge.

    - ``planes``: nominal planes by id.
    - ``plane_sigma``, ``normal_sigma``: standard deviations of the priors of a plane's shift along its normal, m, and of its
      two tilts, rad; 0 where they are exact.
    """

    optional: ClassVar[tuple[str, ...]] = ("height",)
    ids: ClassVar[tuple[str, ...]] = ("plane", "target")

    kind: Literal["plane"]
    planes: Annotated[
        dict[Text, PlaneOf], hint("planes = {A = {point = [x, y, z], normal = [x, y, z]}}, m, base frame")
    ] = Field(min_length=1)
    plane_sigma: NotNegative = 5e-3
    normal_sigma: NotNegative = 5e-3

    def place_information(self, up: Floats) -> Floats:
        """Of each plane, on shifts along its normal and on tilts."""
        found = np.zeros((6, 6))
        for plane in self.planes.values():
            n = np.array(plane.normal) / np.linalg.norm(plane.normal)
            found += shows_place(self.plane_sigma, n @ _points_by_place([plane.point]))
            found += shows_place(self.normal_sigma, _tilts(n))
        return found


class SocketTable(InstrumentTable):
    """A ball in sockets, a pin in holes, a datum sphere: the target is at one point in all rows of one id.

    - ``sockets``: nominal points by id, (3,) each, base frame, m, where they are known.
    - ``socket_sigma``: standard deviation of the priors of their coordinates, m.
    - ``distances``: known distances, as two ids, the distance, m, and its standard deviation, m.
    """

    ids: ClassVar[tuple[str, ...]] = ("socket", "target")
    needed: ClassVar[tuple[str, ...]] = ("socket",)

    kind: Literal["socket"]
    sockets: Annotated[dict[Text, Point], hint("sockets = {S1 = [x, y, z]}, m, base frame")] = Field({})
    socket_sigma: Positive | None = None
    distances: Annotated[tuple[Distance, ...], Field(strict=False), hint(_DISTANCES)] = ()

    @model_validator(mode="after")
    def _has_known_points_with_a_sigma_and_distances_between_two(self) -> Self:
        if bool(self.sockets) != (self.socket_sigma is not None):
            without = "sockets without socket_sigma" if self.sockets else "socket_sigma without sockets"
            raise mistake("socket_sigma", without, "give both where points are known, and neither where they are not")
        for one, two, *_ in self.distances:
            if one == two:
                raise mistake("distances", f"a distance from {one} to itself", _DISTANCES)
        return self

    def place_information(self, up: Floats) -> Floats:
        """That of its known points."""
        return shows_place(self.socket_sigma or 1.0, _points_by_place(self.sockets.values()))


class TiltTable(InstrumentTable):
    """A tilt sensor on a link: the x and y component, in its own frame, of the unit vector against gravity.

    ``link``: name of the link in the URDF or MJCF; None: the platform, with the axes of the TCP frame. ``mount_sigma``:
    standard deviation of the prior of each component of the rotation vector of its mounting, rad.
    """

    numbers: ClassVar[tuple[str, ...]] = ("tilt_x", "tilt_y")
    targetless: ClassVar[str] = "a tilt sensor"

    kind: Literal["tilt"]
    link: Annotated[Text | None, hint('write link = "LINK", as in the robot\'s file; left out, it is the platform')] = (
        None
    )
    mount_sigma: NotNegative = 1e-2

    @property
    def measured_links(self) -> tuple[str, ...]:
        """The link that it sits on."""
        return (self.link,) if self.link else ()

    def place_information(self, up: Floats) -> Floats:
        """On tilts against gravity."""
        return shows_place(self.mount_sigma, _tilts(up))


class EncoderTable(InstrumentTable):
    """An encoder of a passive joint, which no actuator drives.

    ``joint``: name of the joint in the URDF. ``zero_sigma``: standard deviation of the prior of the encoder's zero, rad or m.
    """

    numbers: ClassVar[tuple[str, ...]] = ("reading",)
    targetless: ClassVar[str] = "an encoder"

    kind: Literal["encoder"]
    joint: Annotated[Text, hint('write joint = "NAME", as in the URDF')]
    zero_sigma: NotNegative = 1e-2

    @property
    def measured_joints(self) -> tuple[str, ...]:
        """The joint that it reads."""
        return (self.joint,)

    def place_information(self, up: Floats) -> Floats:
        """None."""
        return np.zeros((6, 6))


class AnyTable(InstrumentTable):
    """The table of an unknown kind of instrument, such as one of the user's own."""

    model_config = ConfigDict(extra="allow", frozen=True, defer_build=True)


TABLES: dict[str, type[InstrumentTable]] = {
    "tracker": TrackerTable,
    "range": RangeTable,
    "plane": PlaneTable,
    "socket": SocketTable,
    "tilt": TiltTable,
    "encoder": EncoderTable,
}
"""The class of the ``[[instrument]]`` section of each kind that gtpin knows."""


def describe_second(
    values: Mapping[str, Any], file: Path | None, own: Mapping[str, type[InstrumentTable]]
) -> tuple[Description, tuple[InstrumentTable, ...]]:
    """What a dataset.toml of schema 2 shares with schema 1, and its instruments; `DatasetError` names an invalid key.

    ``own``: classes of the tables of the user's own instruments, by kind.
    """
    given = values.get("instrument")
    if not isinstance(given, list) or not given or not all(isinstance(one, dict) for one in given):
        text = "write [[instrument]], in double brackets, once for each, with name and kind"
        raise DatasetError("schema 2 has a list of instruments", file=file, column="instrument", hint=text)
    common = describe({key: value for key, value in values.items() if key != "instrument"} | {"schema": SCHEMA}, file)
    kinds = {**TABLES, **own}
    tables = tuple(_instrument(f"instrument.{i}", one, file, kinds) for i, one in enumerate(given))
    names = [table.name.lower() for table in tables]  # names of files: some file systems ignore case
    for i, table in enumerate(tables):
        column, text = f"instrument.{i}.name", "give each a name of its own"
        if names[i] in names[:i]:
            what = f"two instruments are called {table.name}"
            raise DatasetError(what, file=file, column=column, hint=text + ", that differs by more than case")
        if names[i] in RESERVED:
            what = f"no instrument can be called {table.name}, as another file of the folder is"
            raise DatasetError(what, file=file, column=column, hint=text)
    return common, tables


def _instrument(
    place: str, values: Mapping[str, Any], file: Path | None, kinds: Mapping[str, type[InstrumentTable]]
) -> InstrumentTable:
    for key, text in (("name", NAME_HINT), ("kind", f"write kind = one of {', '.join(TABLES)}")):
        if not isinstance(values.get(key), str):
            raise DatasetError(f"an instrument needs a {key}", file=file, column=f"{place}.{key}", hint=text)
    kind = kinds.get(values["kind"])
    if kind is None:
        what, text = f"no instrument is of kind {values['kind']!r}", meant(values["kind"], kinds)
        raise DatasetError(what, file=file, column=f"{place}.kind", hint=text)
    try:
        return kind.model_validate(dict(values))
    except ValidationError as error:
        raise explained(file, error, kind, place) from None


def written(table: InstrumentTable) -> dict[str, Any]:
    """The keys of an ``[[instrument]]`` as they are written: without those that have their default values."""
    return table.model_dump(exclude_none=True, exclude_defaults=True) | {"kind": table.kind}
