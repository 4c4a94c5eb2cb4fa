"""Quantities that an effect displaces: travels of actuators, shifts and rotations of carts, axes of joints and tips of links,
lengths of rods, the frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gtpin.effects.active import ActiveEffect
from gtpin.effects.chain_motions import beam, cart_load, from_end, joint_frame, of_body, of_carried
from gtpin.effects.displacement import Displacement, along_track, of_lengths
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import links_at, tracks, turning_joint
from gtpin.report.words import travel_words
from gtpin.robot.chain import MovingLink
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.placement_frames import frame_of_tcp
from gtpin.typing import Floats

FREEDOMS = ("shift along x", "shift along y", "shift along z", "turn about x", "turn about y", "turn about z")


@dataclass(frozen=True)
class Carried:
    """The load that does work along a displaced quantity.

    ``what``: the part on which it acts, and its direction, in words. ``place``, ``way``: the index of the frame that carries
    it, or the site of a cart, and (6,) the direction as a twist in this frame.
    """

    what: str
    place: int | str
    way: Floats

    def at(self, at: OperatingPoints) -> Floats:
        """(N,) the load, N or N m."""
        if isinstance(self.place, str):
            return np.asarray(np.concatenate(cart_load(at, self.place), axis=1) @ self.way)
        return np.asarray(at.joint_loads[:, self.place] @ self.way)

    @property
    def words(self) -> str:
        """Its name: ``force on ...`` or ``moment on ...``."""
        return f"{'moment' if self.way[3:].any() else 'force'} on {self.what}"

    @property
    def unit(self) -> str:
        """``N`` or ``N m``."""
        return "N m" if self.way[3:].any() else "N"


@dataclass(frozen=True)
class Motion:
    """One quantity that an effect displaces, at N poses.

    - ``name``, ``unit``: its name, such as ``travel of cart1``, and ``m`` or ``rad``.
    - ``columns``: (N, m) displacement of the quantity for a value of 1 of each of the effect's m coefficients.
    - ``tcp``: (N, 6 + k) displacement of the TCP, base frame, m and rad, and of k measured joints, by one unit of the
      quantity.
    - ``rod``: index of the rod whose length it is; None for other quantities.
    - ``straightened``: whether geometry absorbs a straight line of the quantity along the track, not only its mean.
    - ``carried``: the load along the quantity, for a cart always along its track; None where there is none.
    """

    name: str
    unit: str
    columns: Floats
    tcp: Floats
    rod: int | None = None
    straightened: bool = False
    carried: Carried | None = None


def motions(active: ActiveEffect, at: OperatingPoints) -> list[Motion]:
    """All quantities that an effect of typical size displaces by more than a rounding error, 1e-9 m or rad."""
    basis, site, size = active.basis(at), active.site, at.robot.motion_size
    placed = _of_carrier if tracks(at.robot) else placements
    found = [*_travel(at, basis), *placed(at, site, basis)]
    if basis.length is not None:
        for i, rod in enumerate(at.robot.rod_sites):
            one = of_lengths(at, [i], np.ones((len(at), 1, 1)), np.ones(1)).displacement(at)[:, :, 0]
            found.append(Motion(f"length of {rod}", "m", basis.length[:, i], one, i))
    if basis.twist is not None:
        ways = np.broadcast_to(np.eye(size)[:6], (len(at), 6, size)).copy()  # of the frame in the base frame's axes
        own = " of the TCP" if site == "platform" else ""
        if own:  # of the tool in its own axes, as its parameters are
            ways[:, :3, :3] = ways[:, 3:, 3:6] = np.swapaxes(at.poses.R, 1, 2)
        columns = ways[:, :, :6] @ basis.twist[:, :6]
        for k, name in enumerate(FREEDOMS):
            found.append(Motion(f"{name}{own}", "m" if k < 3 else "rad", columns[:, k], ways[:, k]))
    return [m for m in found if np.abs(m.columns * basis.sigma).max(initial=0.0) > 1e-9]


def _travel(at: OperatingPoints, basis: Displacement) -> list[Motion]:
    if basis.command is None:
        return []
    number, columns = basis.command
    site, turning = at.robot.sites[number], at.robot.actuators[number].revolute
    one = along_track(at, site, np.ones((len(at), 1)), np.ones(1)).displacement(at)[:, :, 0]
    unit = "rad" if turning else "m"
    return [Motion(travel_words(at.robot, site), unit, columns, one, carried=_own_load(at, site))]


def _own_load(at: OperatingPoints, site: str) -> Carried:
    """The load about a joint's axis or along it; on a cart the force along its track."""
    frame, still, turning = joint_frame(at, site), np.zeros(3), turning_joint(at.robot, site)
    what = f"{site} {'about' if turning else 'along'} its {'track' if tracks(at.robot) else 'axis'}"
    way = np.concatenate([still, frame.axis] if turning else [frame.axis, still])
    return Carried(what, site if frame.on_cart else frame.index, way)


def _of_carrier(at: OperatingPoints, site: str, basis: Displacement) -> list[Motion]:
    frame = joint_frame(at, site) if basis.placements and site in at.robot.sites else None
    if frame is None or not frame.on_cart:
        return []
    nearest = np.abs(frame.across).argmax(axis=1)  # base axes
    across = [f"towards {'−' if way[k] < 0.0 else '+'}{'xyz'[k]}" for k, way in zip(nearest, frame.across, strict=True)]
    places = ["along its track", *(f"across its track, {a}" for a in across)]
    if frame.turns:
        places += ["about its track (roll)", *(f"about an axis {a}" for a in across)]
    ways = np.kron(np.eye(2), np.vstack([frame.axis, frame.across]))  # rows: three unit shifts, three unit turns
    moved, found = of_carried(at, site, basis), []
    for k, (place, way) in enumerate(zip(places, ways, strict=False)):
        one = of_body(at, site, np.broadcast_to(way[:, None], (len(at), 6, 1)), np.ones(1)).displacement(at)
        columns, unit = np.einsum("nim,i->nm", moved, way), "m" if k < 3 else "rad"
        load = _own_load(at, site)
        found.append(Motion(f"{site} {place}", unit, columns, one[:, :, 0], straightened=k in (1, 2), carried=load))
    return found


def placements(at: OperatingPoints, site: str, basis: Displacement) -> list[Motion]:
    """Motions of a joint's axis, or of the tips of links; those that move the TCP most are first."""
    found = []
    for index, twists in basis.placements:
        link = None
        if site not in at.robot.sites:
            link = next(link for link in links_at(at.robot, site) if index in link.ends)
        if link is not None and link.tip != index:
            continue  # what else a link carries moves with its tip
        owner, ways = _ways(at, site, link)
        ends = [(index, np.eye(6))] if link is None else [(end, from_end(at, index, end)) for end in link.ends]
        for place, way in ways:
            motion, unit = ("shift", "m") if way[:3].any() else ("turn", "rad")
            tcp = np.sum([at.bodies.by_twist(end, (moved @ way)[:, None])[:, :, 0] for end, moved in ends], axis=0)
            columns = np.einsum("nim,i->nm", twists, way)
            # An anchor has no load of its own.
            carried = Carried(f"{owner} {place}", index, way) if index <= frame_of_tcp(at.robot) else None
            found.append(Motion(f"{motion} of {owner} {place}", unit, columns, tcp, carried=carried))

    def at_tcp(motion: Motion) -> float:
        return float(np.abs((motion.columns * basis.sigma)[:, None] * motion.tcp[:, :3, None]).max(initial=0.0))

    return sorted(found, key=lambda motion: -at_tcp(motion))


def _ways(at: OperatingPoints, site: str, link: MovingLink | None) -> tuple[str, list[tuple[str, Floats]]]:
    """Name of the part that is displaced, and six directions, as twists (6,), with their names."""
    if link is None:
        frame = joint_frame(at, site)
        owner, along, (a, b), it = f"the axis of {site}", frame.axis, frame.across, "itself"
    else:
        length = beam(at, link)
        size = float(np.linalg.norm(length))
        along = length / size if size > 0.0 else np.eye(3)[0]
        owner, (a, b), it = f"the tip of {link.name}", rotation_axes(along)[:2], "the link"
    names = (("along", it, along), ("across it, along", "a", a), ("across it, along", "b", b))
    shifts = [(f"{how} {what}", np.concatenate([axis, np.zeros(3)])) for how, what, axis in names]
    turns = [(f"about {what}", np.concatenate([np.zeros(3), axis])) for _, what, axis in names]
    return owner, shifts + turns
