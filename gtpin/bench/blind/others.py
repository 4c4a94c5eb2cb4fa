"""Cases that somebody else made: datasets and their truth files."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel

from gtpin.bench.blind.truth import (
    Kind,
    Six,
    TrueEffect,
    TrueNoise,
    TruePoses,
    TrueReadings,
    Truth,
    digest_of_files,
    files_of,
    read_json,
)
from gtpin.data.description import SECOND, Description, describe, read_toml, write_description
from gtpin.data.files import find_table, read_bytes, read_table
from gtpin.data.instrument_tables import InstrumentTable, describe_second, written
from gtpin.data.names import POSITION
from gtpin.effects.catalogue import effects_by_id
from gtpin.errors import DatasetError, GtpinError
from gtpin.output.results import writing
from gtpin.references import is_path
from gtpin.robot.chain import Chain
from gtpin.robot.closures import SUFFIX
from gtpin.robot.description import RobotDescription
from gtpin.robot.library import load_robot

TRUTH, POSES = ".truth.json", ".truth.csv"
ROBOT = "robot.urdf"
"""Name of a dataset's own URDF once it is in the dataset's folder."""


class _TruthFile(BaseModel, frozen=True):
    """The content of ``NAME.truth.json``; all keys but ``effects`` are there only if gtpin wrote it."""

    effects: tuple[TrueEffect, ...]
    kind: Kind | None = None
    sigma: Six | None = None
    readings: tuple[TrueReadings, ...] = ()
    noise: tuple[TrueNoise, ...] = ()


def given(folder: Path) -> dict[Path, Truth]:
    """The truths of all cases in a folder, ``NAME.truth.json``, by the folders ``NAME/`` of their datasets, ordered by name.

    Raises GtpinError if there are no cases, a dataset has no truth, a truth has no dataset, or a truth can't be read.
    """
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        reason = error.strerror or str(error)
        raise GtpinError(f"can't be read ({reason})", file=folder, hint="name a folder of cases") from None
    truths = {entry.name.removesuffix(TRUTH) for entry in entries if entry.name.endswith(TRUTH)}
    datasets = {entry.name for entry in entries if entry.is_dir() and not entry.name.startswith(".")}
    if not truths and not datasets:
        hint = "it needs NAME/ and NAME.truth.json for each case"
        raise GtpinError("there are no cases here", file=folder, hint=hint)
    for name in sorted(datasets ^ truths):
        file = folder / (f"{name}{TRUTH}" if name in datasets else name)
        hint = "each case is a folder NAME/ and a file NAME.truth.json next to it"
        raise GtpinError("is missing", file=file, hint=hint)
    found = {}
    for name in sorted(truths):
        file = folder / f"{name}{TRUTH}"
        content = read_json(file, _TruthFile, 'write {"effects": [{"effect": ID, "site": SITE}, ...]}')
        _check(file, content, folder / name)
        kind = content.kind or kind_of([effect.effect for effect in content.effects])
        found[folder / name] = Truth(**{**dict(content), "kind": kind}, poses=_poses(folder, name))
    return found


def _check(file: Path, content: _TruthFile, dataset: Path) -> None:
    """Raise an error for known effects at sites that the robot does not have, and for an effect that is listed twice."""
    robot: Chain | None = None
    with contextlib.suppress(GtpinError):  # the diagnosis reports a dataset that can't be read
        said, _ = _described(dataset / "dataset.toml")
        robot = load_robot(_path_of(dataset, said.robot) or said.robot, said.tcp, said.actuators)
    for number, effect in enumerate(content.effects):
        where = f"effects.{number}.site"
        sites = effects_by_id()[effect.effect].sites(robot) if robot and effect.effect in effects_by_id() else None
        if sites is not None and effect.site not in sites:
            what, hint = f"{effect.effect} can't be at {effect.site!r}", f"use {', '.join(sites)}"
            raise GtpinError(what, file=file, column=where, hint=hint)
        if effect.name in {other.name for other in content.effects[:number]}:
            raise GtpinError(f"{effect.name} is there twice", file=file, column=where, hint="keep one of them")


def kind_of(effects: list[str]) -> Kind:
    """The kind of case, from its effects."""
    known = sum(effect in effects_by_id() for effect in effects)
    kinds: Mapping[tuple[int, int], Kind] = {
        (0, 0): "none",
        (1, 0): "one",
        (2, 0): "two",
        (3, 0): "three",
        (0, 1): "unlisted",
        (1, 1): "known_and_unlisted",
    }
    return kinds.get((known, len(effects) - known), "many")


def _described(file: Path) -> tuple[Description, tuple[InstrumentTable, ...]]:
    """The content of a dataset.toml, and its instruments; none where it is of schema 1."""
    values = read_toml(file)
    return describe_second(values, file, {}) if values.get("schema") == SECOND else (describe(values, file), ())


def _path_of(folder: Path, robot: str) -> Path | None:
    return Path(os.path.abspath(folder / robot)) if is_path(robot) else None


def _poses(folder: Path, name: str) -> TruePoses | None:
    """The true poses, which must be those of the commands."""
    file = folder / f"{name}{POSES}"
    if not file.exists():
        return None
    table = read_table(file)
    pose, T, turns = table.column("pose").tolist(), table.matrix(POSITION), table.orientation()
    if len(set(pose)) < len(pose):
        raise DatasetError("a pose is there twice", file=file, column="pose", hint="give each command one true pose")
    commands = find_table(folder / name, "commands")
    if commands is None:
        hint = "the true poses are those at its commands"
        raise DatasetError("the file is missing", file=folder / name / "commands.csv", hint=hint)
    other = set(pose) ^ set(read_table(commands).column("pose").tolist())
    if other:
        what = f"pose {sorted(other)[0]} is not in both this file and {commands.name}"
        raise DatasetError(what, file=file, column="pose", hint="give each command its true pose")
    return TruePoses(
        pose=tuple(pose),
        position=tuple(map(tuple, T.tolist())),
        orientation=None if turns is None else tuple(map(tuple, turns.tolist())),
    )


def source_digest(cases: Mapping[Path, Truth]) -> str:
    """SHA-256 of all datasets and truths, by name."""
    files = {f"{place.name}/{name}": content for place in cases for name, content in files_of(place).items()}
    return digest_of_files(
        files | {f"{at.name}/truth": truth.model_dump_json().encode() for at, truth in cases.items()}
    )


def take_in(dataset: Path, place: Path) -> None:
    """Copy a dataset, with the URDF that it names."""
    with writing(place):
        place.mkdir(parents=True, exist_ok=True)
        for name, content in files_of(dataset).items():
            (place / name).write_bytes(content)
        try:
            said, instruments = _described(dataset / "dataset.toml")
            urdf = _path_of(dataset, said.robot)
            if urdf is not None:
                of_two = urdf.suffix.lower() == SUFFIX  # a URDF and its loops in another file
                (place / ROBOT).write_bytes(RobotDescription.read(urdf).xml.encode() if of_two else read_bytes(urdf))
                moved = said.model_copy(update={"robot": ROBOT})
                write_description(place / "dataset.toml", moved, [written(one) for one in instruments])
        except GtpinError:
            return  # its diagnosis reports the error
