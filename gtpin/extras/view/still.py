"""A still image of the machine and its gap. It needs matplotlib, which the extras ``plots`` and ``view`` bring."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from gtpin.errors import GtpinError, ModelError
from gtpin.extras.view.displays import GREY, joint_places, of_errors, of_share, platform_name, robot_as_modelled
from gtpin.extras.view.gap import DrawnGap
from gtpin.kinematics.poses import Poses
from gtpin.kinematics.posture import home
from gtpin.model.model import FittedInstrument, Model
from gtpin.output.figure import new_figure
from gtpin.output.results import result_file
from gtpin.report.figure import ACCENT, FIT, GOOD, WARN, ZERO
from gtpin.report.instrument_places import InstrumentPlaces, patch
from gtpin.report.residuals import evenly
from gtpin.report.skeleton import ELEVATION, Camera, Kind, Skeleton, skeleton, standing
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = (".png", ".svg", ".pdf")
LINE = 90
"""Largest number of characters in a line of the title."""
MOST = 400
"""Largest number of errors that are drawn. Of more, this number is taken evenly from the table."""
LINES: dict[Kind, tuple[Any, float, float]] = {
    "track": (GREY, 5.0, 0.4),
    "arm": (GREY, 5.0, 0.6),
    "bracket": ("0.35", 2.0, 1.0),
    "rod": (GREY, 1.8, 1.0),
    "link": ("0.35", 4.0, 1.0),
    "fixed": (GREY, 3.0, 0.6),
}
"""Colour, width in points and opacity of the machine's lines, by kind; a rod's colour and width grow with its share."""
FLAT = 0.1
"""A picture whose extent along an axis is less than this fraction of the largest one is flat along this axis."""
PATCH, AXIS = 0.12, 0.08
"""Half the side of a plane's patch, and length of a sensor's axes, over the picture's size."""


def still(model: Model, gap: DrawnGap | None = None, instruments: Sequence[FittedInstrument] | None = None) -> Figure:
    """A picture of a machine and its instruments, the errors magnified, rods coloured by their share of the gap.

    ``instruments``: the instruments to show; the model's by default.

    Raises `ModelError` if the machine can't be drawn. `GtpinError` if matplotlib is missing.
    """
    worst = None if gap is None else gap.q[int(np.argmax(gap.size))]
    machine = skeleton(model, worst)
    if machine is None:
        raise ModelError(f"{model.robot.name} can't be drawn: it does not reach its home", hint="check its geometry")
    figure = new_figure(9.0, 7.0)
    axes: Any = figure.add_subplot(projection="3d")
    _machine(axes, machine, model.robot, {} if gap is None else gap.share)
    title = model.robot.name
    if gap is not None:
        title = "\n".join([f"{title}: {gap.what}", *wrap(_errors(axes, gap), LINE)])
    axes.set_title(title, fontsize=11)
    seen = machine.points if gap is None else np.vstack([machine.points, gap.T])
    places = InstrumentPlaces.of(model.instruments if instruments is None else instruments)
    if places:
        q = standing(model) if worst is None else worst
        pose, size = model.kinematics.forward(q[None]), float(np.ptp(seen, axis=0).max())
        joints: dict[str, Floats] = {}  # (3,) where the joints that encoders read are, base frame, m
        if places.encoders:
            robot = robot_as_modelled(model)
            data = robot.model.createData()
            pin.forwardKinematics(robot.model, data, home(robot).moved_to(q).configuration)
            joints = joint_places(robot, data, places.encoders.values())
        seen = np.vstack([seen, draw_instruments(axes, places, pose, size, joints)])
    _frame(axes, machine, seen)
    return figure


def write_still(
    file: Path,
    model: Model,
    gap: DrawnGap | None = None,
    *,
    force: bool = False,
    instruments: Sequence[FittedInstrument] | None = None,
) -> None:
    """Write a still image: PNG, SVG or PDF, by the suffix of the file's name.

    With ``force``, a file that gtpin has not written, or that was changed since, is renamed to ``NAME.old-1``.

    Raises `GtpinError` if the suffix is another, or the file can't be written. Without ``force``, also if the file exists
    and gtpin has not written it, or it was changed since.
    """
    if file.suffix.lower() not in FORMATS:
        raise GtpinError("not an image that can be written", file=file, hint=f"end its name in {', '.join(FORMATS)}")
    with result_file(file, force=force) as new:
        still(model, gap, instruments).savefig(new, metadata={"Date": None} if file.suffix.lower() == ".svg" else None)


def _machine(axes: Any, machine: Skeleton, robot: Chain, share: Mapping[str, float]) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    for line in machine.lines:
        part, (color, width, alpha) = share.get(line.site, 0.0), LINES[line.kind]
        if line.kind == "rod":
            color, width = of_share(part), 1.8 + 3.0 * part
        axes.plot(*line.ends.T, color=color, linewidth=width, alpha=alpha, solid_capstyle="round")
        if line.kind == "rod":
            words = f"{line.site} {100.0 * part:.0f} %" if part >= 0.05 else line.site
            a, b = line.ends
            _name(axes, a + 0.35 * (b - a), words, fontsize=8, color="0.3")
    for spot in machine.spots:
        cart = spot.axis is None
        axes.plot(*spot.at, "s" if cart else "o", color="0.35" if cart else "0.2", markersize=8 if cart else 7)
        _name(axes, spot.at, f"  {spot.site}", fontsize=9 if cart else 8)
    corners = machine.platform
    if len(corners) > 2:
        pairs = zip(*np.triu_indices(len(corners), 1), strict=True)
        hull = [[corners[i], corners[j], corners.mean(axis=0)] for i, j in pairs]
        axes.add_collection3d(Poly3DCollection(hull, facecolor=(0.15, 0.35, 0.65, 0.25)))
    axes.plot(*machine.tcp, "o", color="white", markeredgecolor="black", markersize=5)
    _name(axes, machine.tcp, f"  {platform_name(robot)}")


def _name(axes: Any, at: Floats, words: str, **style: Any) -> None:
    """Draw words in front of everything else, with a white rim to be readable on it."""
    from matplotlib.patheffects import withStroke

    rim = [withStroke(linewidth=2.0, foreground="white")]
    axes.text(*at, words, **{"fontsize": 9, "path_effects": rim, "zorder": 1000} | style)


def _errors(axes: Any, gap: DrawnGap) -> str:
    """Draw the errors. Returns text with their size and magnification."""
    rows = evenly(len(gap.q), MOST)
    factor, colors = gap.magnification(), of_errors(gap.size)[rows]
    T, ends = gap.T[rows], gap.T[rows] + factor * gap.error[rows]
    axes.scatter(*T.T, color=colors, s=9, depthshade=False)
    for a, b, color in zip(T, ends, colors, strict=True):
        axes.plot(*np.stack([a, b]).T, color=color, linewidth=1.0)
    return f"{gap.summary}, drawn {factor:,.0f} times larger"


def _frame(axes: Any, machine: Skeleton, points: Floats) -> None:
    """Set equal scales of the axes, and the direction of view in which rods hide each other the least; gravity points down if
    it is along an axis. What is flat along an axis is seen along it."""
    from matplotlib.ticker import MaxNLocator

    low, high = points.min(axis=0), points.max(axis=0)
    room = 0.03 * float((high - low).max())
    for k, name in enumerate("xyz"):
        getattr(axes, f"set_{name}lim")(low[k] - room, high[k] + room)
        getattr(axes, f"set_{name}label")(f"{name} (m)")
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(5))
    axes.set_box_aspect(high - low + 2.0 * room, zoom=1.15)
    axes.set_proj_type("ortho")
    right, up = Camera.of(machine).axes
    eye = np.cross(right, up)
    vertical = int(np.argmax(np.abs(machine.up)))
    first, second = (vertical + 1) % 3, (vertical + 2) % 3
    azimuth = np.rad2deg(np.arctan2(eye[second], eye[first]))
    elevation, flat = np.rad2deg(ELEVATION), int(np.argmin(high - low))
    if high[flat] - low[flat] < FLAT * (high - low).max():
        getattr(axes, f"set_{'xyz'[flat]}ticks")([])
        getattr(axes, f"set_{'xyz'[flat]}label")("")
        elevation, azimuth = 90.0 if flat == vertical else 0.0, 0.0 if flat == first else -90.0
    axes.view_init(elev=float(elevation), azim=float(azimuth), vertical_axis="xyz"[vertical])


def draw_instruments(
    axes: Any, places: InstrumentPlaces, pose: Poses, size: float, joints: Mapping[str, Floats]
) -> Floats:
    """Draw instruments, with the platform at ``pose`` (one pose).

    ``axes``: matplotlib's 3-D axes. ``size``: size of everything else in the picture, m. ``joints``: (3,) positions of the
    encoders' joints by their names in the URDF, base frame, m.

    """
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    T, R = pose.T[0], pose.R[0]
    targets = {name: T + R @ at for name, at in places.targets.items()}
    for one, two in places.wires:
        axes.plot(*np.stack([places.stations[one], targets[two]]).T, color=ZERO, linewidth=0.9, linestyle="--")
    for name, at in places.stations.items():
        axes.plot(*at, "^", color=ACCENT, markersize=8)
        axes.text(*at, f"  {name}", fontsize=8, color=ACCENT)
    for at in targets.values():
        axes.plot(*at, "o", color=FIT, markersize=4)
    seen = [places.fixed]
    for name, (point, normal) in places.planes.items():
        corners = patch(point, normal, PATCH * size)
        axes.add_collection3d(Poly3DCollection([corners], facecolor=GOOD, alpha=0.25))
        tip = point + 0.5 * PATCH * size * normal
        axes.plot(*np.stack([point, tip]).T, color=GOOD, linewidth=1.6)
        axes.text(*tip, name, fontsize=8, color=GOOD)
        seen.append(corners)
    for name, at in places.sockets.items():
        axes.plot(*at, "o", color=WARN, markersize=6)
        axes.text(*at, f"  {name}", fontsize=8, color=WARN)
    for one, two, length in places.distances:
        ends = np.stack([places.sockets[one], places.sockets[two]])
        axes.plot(*ends.T, color=WARN, linewidth=1.4)
        axes.text(*ends.mean(axis=0), f"{1e3 * length:g} mm", fontsize=7, color=WARN)
    for turned in places.tilts.values():
        for color, axis in zip((FIT, GOOD, ACCENT), (R @ turned).T, strict=True):
            axes.plot(*np.stack([T, T + AXIS * size * axis]).T, color=color, linewidth=2.0)
    for name, joint in places.encoders.items():
        axes.plot(*joints[joint], "D", color=FIT, markersize=7)
        axes.text(*joints[joint], f"  {name}", fontsize=8, color=FIT)
        seen.append(joints[joint][None])
    return np.vstack(seen)
