"""Instruments in a still image: stations, wires, planes, sockets with known distances, tilt sensors, encoders."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from gtpin.kinematics.poses import Poses
from gtpin.report.instrument_places import InstrumentPlaces
from gtpin.report.palette import ACCENT, FIT, GOOD, WARN, ZERO
from gtpin.report.patches import patch
from gtpin.typing import Floats

PATCH, AXIS = 0.12, 0.08
"""Half the side of a plane's patch, and length of a sensor's axes, over the picture's size."""


def draw_instruments(
    axes: Any, places: InstrumentPlaces, pose: Poses, size: float, joints: Mapping[str, Floats]
) -> Floats:
    """Draw instruments, with the platform at ``pose`` (one pose).

    Parameters
    ----------
    axes
        Matplotlib's 3-D axes.
    size
        Size of everything else in the picture, m.
    joints
        (3,) positions of the encoders' joints by their names in the URDF, base frame, m.

    Returns
    -------
    (m, 3) points that must be inside the picture, base frame, m.
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
