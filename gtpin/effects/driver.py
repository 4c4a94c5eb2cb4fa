"""A recorded column, or several of one sensor, that move a site: what ``[[driver]]`` tables of a dataset describe."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from gtpin.data import Dataset
from gtpin.data.description import MOTIONS, Driver
from gtpin.effects.chain_motions import from_end, joint_frame, of_joint
from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import Effect, Parameters
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import guided, links, turns
from gtpin.effects.smooth import of_frame
from gtpin.errors import DatasetError
from gtpin.kinematics.rotations import frame_motions
from gtpin.robot.chain import Chain, moving_links, on_link
from gtpin.robot.placement_frames import frame_of_joint
from gtpin.typing import Floats


@dataclass(frozen=True, eq=False)
class InstrumentAxes:
    """The instrument's pose in the base frame: its origin (3,), m, and its axes as the columns of a (3, 3) matrix."""

    origin: Floats = field(default_factory=lambda: np.zeros(3))
    axes: Floats = field(default_factory=lambda: np.eye(3))


def refusal(robot: Chain, site: str, motion: str) -> str | None:
    """Why a site can't make a motion (``x`` ... ``rz``, ``q``), as a sentence; None where it can."""
    if site in ("platform", "frame"):
        return f"{site} is no joint, so it has no q" if motion == "q" else None
    if site in robot.sites:
        if motion == "q" or site in guided(robot):
            return None
        return f"{site} slides no carrier along a track, so that it has its q only"
    if links(robot):
        return f"{site} is no site that a column can move: of this robot its actuators, platform and frame are"
    if motion == "q":
        return f"{site} is no actuator of this dataset, so it has no q"
    return None if _carried(robot, site) else f"nothing that a column can move is at {site}"


def moved(
    at: OperatingPoints, site: str, motions: Sequence[str], columns: Floats, sigma: Floats, instrument: InstrumentAxes
) -> Displacement:
    """Displacements of a site by w motions with c columns each: ``columns`` is (N, w, c), m or rad; ``sigma`` (w c,) sizes.

    ``q`` is along or about the joint's own axis. The other motions are along and about the axes of a frame: for a joint its
    placement frame; for a moving link the frame of its tip; for a link that is fixed to the base its own frame; for a cart the
    base frame's axes through the mean of the cart's joints; for the platform the TCP frame; for ``frame`` (the measured poses)
    the instrument's frame.
    """
    robot = at.robot
    if all(motion == "q" for motion in motions):
        return along_track(at, site, columns.reshape(len(at), -1), sigma)
    ways = np.zeros((6, len(motions)))
    for w, motion in enumerate(motions):
        if motion != "q":
            ways[MOTIONS.index(motion), w] = 1.0
        else:
            turning = robot.actuators[robot.sites.index(site)].revolute
            ways[3 if turning else 0 : 6 if turning else 3, w] = joint_frame(at, site).axis
    if site in robot.sites:
        return of_joint(at, site, ways, columns, sigma)
    twist = np.einsum("iw,nwc->niwc", ways, columns).reshape(len(at), 6, -1)
    if site == "platform":
        R = at.poses.R
        return Displacement(sigma, twist=np.concatenate([R @ twist[:, :3], R @ twist[:, 3:]], axis=1))
    if site == "frame":
        turned = np.concatenate([instrument.axes @ twist[:, :3], instrument.axes @ twist[:, 3:]], axis=1)
        return Displacement(sigma, twist=of_frame(at, frame_motions(at.poses.T - instrument.origin) @ turned))
    frame, carried = _frame(robot, site), _carried(robot, site)
    if frame is not None and not frame.parentJoint:
        actions = [np.asarray(on_link(robot, end).actInv(frame.placement).action) for end in carried]
    else:
        actions = [from_end(at, carried[0], end) for end in carried]
    return Displacement(sigma, placements=tuple((end, way @ twist) for end, way in zip(carried, actions, strict=True)))


def _frame(robot: Chain, site: str) -> pin.Frame | None:
    """Pinocchio's frame of a link, by its name; None where there is no such link."""
    return next((f for f in robot.model.frames if f.name == site and f.type == pin.FrameType.BODY), None)


def _carried(robot: Chain, site: str) -> tuple[int, ...]:
    """Indices of the placement frames, TCP and anchors that move with a link, that of its tip first; empty where none does."""
    frame, model = _frame(robot, site), robot.model
    if frame is None:
        return ()
    if frame.parentJoint:
        return next((link.ends for link in moving_links(robot) if link.joint_id == frame.parentJoint), ())
    return tuple(frame_of_joint(j) for j in range(1, model.njoints) if model.parents[j] == 0)


PREFIX = "driver:"
"""Beginning of the ids of such effects; the name of the column, or of the sensor of several columns, follows."""


@dataclass(frozen=True)
class DriverColumn:
    """A recorded column: its name, and its mean and range in the data that the effect was fitted to."""

    name: str
    mean: float
    range: float


class DriverEffect(Effect):
    """u = c (v + s 2 v^2), v = (column - mean) / range: a site moves with a recorded column, or with all columns of a sensor.

    u is the displacement along an axis of the site's frame, m, or the rotation about it, rad, positive in the direction of the
    axis (right-handed). The mean and the range (largest less smallest value) of the column are those of the fitted data, so c
    is the motion over the column's range. The modulation s: the motion is not linear in the column.

    Parameters, for each motion that the ``[[driver]]`` tables name: ``x``, ``y``, ``z``, m, ``rx``, ``ry``, ``rz``, rad, or
    ``q``, m or rad: c; ``x_curvature`` and so on: c s, in the same unit.

    Typical size: ``size`` in the dataset's ``[[driver]]`` table.
    """

    def __init__(
        self, columns: Iterable[DriverColumn], drivers: Iterable[Driver], instrument: InstrumentAxes | None = None
    ) -> None:
        """Take the columns of one sensor, their ``[[driver]]`` tables, and the instrument's pose (None: the base frame)."""
        self.columns = {column.name: column for column in columns}
        self.drivers, self.instrument = tuple(drivers), instrument or InstrumentAxes()
        name, sensor = self.drivers[0].column, self.drivers[0].sensor
        self.id = PREFIX + (sensor or name)
        what = f"the sensor {sensor}" if sensor else f"the column {name}"
        self.title = f"motion with {what}"
        self.clause = f"{{site}} moves with {what}"
        self.remedy = f"Use the corrected model with {what} recorded, or take away what it measures."
        self.coefficient = (self.drivers[0].motion, "")
        self.needs = self.depends_on = tuple(self.columns)
        self._by_site: dict[str, list[Driver]] = {}
        for driver in self.drivers:
            self._by_site.setdefault(driver.site, []).append(driver)
        counts = {len(own) for own in self._by_site.values()}
        # The core's indices are the same at all sites only where all sites have the same number of motions.
        self.core = tuple(range(0, 2 * counts.pop(), 2)) if len(counts) == 1 else ()

    def sites(self, robot: Chain) -> tuple[str, ...]:
        return tuple(self._by_site)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        mine = self._by_site[site]
        own = [self.columns[driver.column] for driver in mine]
        v = np.stack([(at.covariate(one.name) - one.mean) / one.range for one in own], axis=1)
        columns = np.stack([v, 2.0 * v**2], axis=2)
        sigma = np.outer([driver.size for driver in mine], [1.0, MODULATION.curvature]).ravel()
        return moved(at, site, [driver.motion for driver in mine], columns, sigma, self.instrument)

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        found: Parameters = {}
        for driver, (linear, curved) in zip(self._by_site[site], coefficients.reshape(-1, 2), strict=True):
            angular = driver.motion.startswith("r") or (driver.motion == "q" and turns(robot, site))
            unit = "rad" if angular else "m"
            found |= {driver.motion: (float(linear), unit), f"{driver.motion}_curvature": (float(curved), unit)}
        return found


def driver_effects(
    dataset: Dataset, robot: Chain, instrument: InstrumentAxes | None = None
) -> tuple[DriverEffect, ...]:
    """The effects that a dataset's ``[[driver]]`` tables describe, one for each sensor, or column without one.

    ``instrument``: its pose, for motions of the site ``frame``; None: the base frame.

    Raises `DatasetError` if a site of this robot can't make the named motion, or the column is not recorded.
    """
    file = None if dataset.path is None else dataset.path / "dataset.toml"
    for number, driver in enumerate(dataset.drivers):
        why = refusal(robot, driver.site, driver.motion)
        if why:
            known = dict.fromkeys((*robot.sites, *(link.name for link in moving_links(robot)), "platform", "frame"))
            key = "motion" if driver.site in known else "site"
            raise DatasetError(why, file=file, column=f"driver.{number}.{key}", hint=f"sites are {', '.join(known)}")
        if driver.column not in dataset.covariates:
            what = f"no column of numbers is called {driver.column!r}"
            raise DatasetError(
                what, file=file, column=f"driver.{number}.column", hint="record it, or take the driver out"
            )
    together: dict[str, list[Driver]] = {}
    for driver in dataset.drivers:
        together.setdefault(driver.sensor or driver.column, []).append(driver)
    return tuple(
        DriverEffect([_column(dataset, name) for name in dict.fromkeys(d.column for d in own)], own, instrument)
        for own in together.values()
    )


def _column(dataset: Dataset, name: str) -> DriverColumn:
    """A column of a dataset; the range of one that does not vary is not used, since its effect can't be tested."""
    values = np.asarray(dataset.covariates[name], dtype=float)
    return DriverColumn(name, float(values.mean()), float(np.ptp(values)) or 1.0)
