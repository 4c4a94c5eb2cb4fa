"""Errors of a track: it is not straight, its cart turns, or gives way under load, and it grows with heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.chain_motions import cart_load, joint_frame, of_body, of_joint, own_axis
from gtpin.effects.displacement import Displacement, along_track
from gtpin.effects.effect import ChainWords, Effect, ParameterRange, Parameters, unit
from gtpin.effects.joints import no_load, symmetric
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import joints, slides, sliding_actuators, tracks, turns
from gtpin.effects.smooth import approach, cosines, extent, flexibility, wave
from gtpin.effects.untestable import Untestable
from gtpin.robot.chain import Chain
from gtpin.robot.parameters import rotation_axes
from gtpin.robot.placement_frames import frame_of_joint
from gtpin.typing import Floats

ORDERS, DECAY = 20, 1.2
"""Number of cosines along the track for each direction or axis, and the power p: the size of order k goes with k^-p."""


class _GuideErrors(Effect):
    """Error motions of a cart in its guide, each a sum of cosines along the track, smaller for higher orders."""

    nature = "profile"
    coefficient = ("first_wave", "m")
    acts_at = staticmethod(sliding_actuators)
    motions: ClassVar[tuple[str, ...]]
    """The motions, as in the names of parameters: along, or about, the track (``roll``), a and b."""
    size: ClassVar[float]
    """Typical size of a motion, m or rad."""

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        waves, size = cosines(at.travel[:, at.robot.sites.index(site)], 1, ORDERS, DECAY)
        frame, ways = joint_frame(at, site), np.zeros((6, len(self.motions)))
        axes = {"roll": frame.axis, "a": frame.across[0], "b": frame.across[1]}
        first = 3 if self.coefficient[1] == "rad" else 0
        ways[first : first + 3] = np.array([axes[motion] for motion in self.motions]).T
        columns = np.broadcast_to(waves[:, None, :], (len(at), len(self.motions), ORDERS))
        return of_joint(at, site, ways, columns, unit(np.tile(size, len(self.motions)), self.size))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        found: Parameters = {}
        for motion, part in zip(self.motions, np.split(coefficients, len(self.motions)), strict=True):
            for name, value in zip(("rms", "peak_to_valley"), extent(part), strict=True):
                found[f"{name}_{motion}"] = (value, self.coefficient[1])
        return found


class Straightness(_GuideErrors):
    """dC = f_a(q) a + f_b(q) b, a smooth displacement of the cart, m, the same for all its joints. ISO 230-1: EYX, EZX.

    q is the command. a and b are unit vectors across the track, base frame: the parameters ``track_direction[cart].a`` and
    ``.b`` rotate the track about them. For the Gantry-Tau a points up and b is horizontal, with track x a = b.

    Parameters: ``rms_a``, ``rms_b``, ``peak_to_valley_a``, ``peak_to_valley_b``, m, each after the best straight
    line is subtracted, because a slope belongs to the direction of the track, which is geometry.

    Typical size: root mean square of f_a and of f_b 40 um. A good guide rail runs parallel to its mounting surface to
    about 30 um over 2 m (Picard, "One micron can make the difference", picard.de).
    """

    id = "straightness"
    title = "track that is not straight"
    clause = "the track of {site} is not straight"
    remedy = "Realign the guideway by the curve below, or use the corrected model."
    motions = ("a", "b")
    size = 4e-5


class CartRotation(_GuideErrors):
    """dC = w(q) x (C - M), M the mean of the cart's joints. ISO 230-1: EAX, EBX and ECX of a track X.

    C are the positions of the cart's joints, base frame, m, and dC their displacements. w is a small right-handed rotation
    vector, rad, base frame: about the track (roll) and about the axes a and b across it (pitch and yaw;
    :class:`~gtpin.effects.tracks.Straightness` defines a and b). It is a smooth function of the command q. The rotation
    of a cart with a single joint has no effect on the TCP.

    Parameters: ``rms_roll``, ``rms_a``, ``rms_b`` and ``peak_to_valley_roll``, ``_a``, ``_b``, rad, each after the best
    straight line along the track is subtracted.

    Typical size: root mean square of each component 0.1 mrad, as of two runner blocks 0.4 m apart, one of which is
    displaced by 40 um.
    """

    id = "cart_rotation"
    title = "roll, pitch and yaw along the track"
    clause = "{site} rolls, pitches or yaws along its track"
    remedy = "Check the guideway's parallelism and the carriage's preload, or use the corrected model."
    coefficient = ("first_wave", "rad")
    motions = ("roll", "a", "b")
    size = 1e-4

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | None:
        return None if joint_frame(at, site).turns else Untestable("single_joint")


class ThermalTrack(Effect):
    """dq = alpha (q - q0) (temp_frame - reference); dq is the deviation of the travel from the command q, m.

    q0 is the fixed point: the command at which the track does not move. When the frame is warmer than the reference and
    alpha > 0, a cart at q > q0 is farther along its track than commanded. The reference is the dataset's
    ``reference_temperature``, degC. The coefficients are alpha and -alpha q0. The modulation: one end of the track may become
    warmer than the other, and the expansion may change with time, because the sensor does not measure the track itself.

    Parameters: ``expansion`` alpha, 1/K; ``at_zero`` = -alpha q0, m/K: the displacement of the cart at q = 0 per kelvin;
    ``fixed_point`` q0, m, which is inaccurate where alpha is small.

    Typical size: alpha 1e-5 / K; ``at_zero`` 7e-6 m/K. Steel has 12e-6 / K (handbook value); the frame that holds the
    track may expand less or more.
    """

    id = "thermal_track"
    title = "thermal growth of the track"
    clause = "the guideway of {site} grows with the frame's temperature"
    of_chains = ChainWords(clause="the travel of {site} grows with the frame's temperature")
    remedy = "Let the machine warm up, or use the corrected model with the frame's temperature measured."
    coefficient = ("expansion", "1/K")
    needs = ("temp_frame",)
    uses = ("time",)
    of_travel = True
    core = (0, 1)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "expansion": ParameterRange(
            -2e-6, 1e-4, "no guideway shrinks with heat, and even plastics expand by only 1e-4/K"
        )
    }
    expected_range: ClassVar[Mapping[str, ParameterRange]] = {
        "expansion": ParameterRange(
            4e-6, 3.5e-5, "steel has 12e-6/K, and few guideways have a third or three times as much"
        )
    }

    def sites(self, robot: Chain) -> tuple[str, ...]:
        # An angle does not grow with heat.
        return tuple(site for site in tracks(robot) if not turns(robot, site))

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        j = at.robot.sites.index(site)
        warm = at.covariate("temp_frame") - at.references.temperature
        q = at.q[:, j]
        columns = [warm * q, warm, warm * q * at.travel[:, j]]
        sizes = [1.0, 0.7, MODULATION.uneven]
        if at.has("time"):
            columns += [warm * q * at.lateness, warm * at.lateness]
            sizes += [MODULATION.late, MODULATION.late_zero]
        return along_track(at, site, np.stack(columns, axis=1), unit(sizes, 1e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        expansion, zero = (float(c) for c in coefficients[:2])
        fixed = -zero / expansion if expansion else 0.0
        return {"expansion": (expansion, "1/K"), "at_zero": (zero, "m/K"), "fixed_point": (fixed, "m")}


GIVE = (5e-8, 3e-8, 3e-8)
"""Typical sizes of the compliances along and across the track, m/N."""
TIP = 5e-7
"""Typical size of the rotational compliances, rad/(N m)."""
LEVER = 0.1
"""Usual distance of the line of action of the force from the mean of the cart's joints, m."""
PLACES = 4
"""Number of cosines that describe how the compliance varies along the track."""
TIPS = 3 * (4 + PLACES)
"""Number of coefficients of the compliances along and across. The rotational compliances follow them."""


class CartCompliance(Effect):
    """dC = sum_e c_e (F . e) e + sum_e k_e (M . e) e x (C - m); dC is the displacement of a joint C of the cart, m.

    The sums are over three unit vectors e: the direction of the track, and a and b across it (see ``straightness``). All
    vectors are in the base frame. F, N, is the sum of the rods' forces on the cart (a rod in tension pulls its cart towards
    the platform). M, N m, is their moment about m, the mean of the cart's joints. The forces are computed with the closures'
    Jacobian from gravity of plate, links and payload, and from the force on the tool. The modulation: the compliances c_e and
    k_e depend on the load and on the place along the track; c_e may differ where F . e is below half of its usual value, as in
    a spring with a dead zone or in a contact. Friction causes a small hysteresis.

    Parameters: ``along``, ``across_a``, ``across_b``: c_e, m/N, at forces that are not small, positive where the cart moves in
    the direction of the force;
    ``stiffening``: by how much ``along`` increases, m/N, when the force becomes twice the usual one, negative where the cart
    becomes stiffer; for a cart with more than one joint also ``roll``, ``tip_a``, ``tip_b``: k_e, rad/(N m), positive where
    the cart turns in the direction of the moment.

    At a sliding joint of a robot without rods, what bends is the structure between the joint before it (the base's frame, for a
    first joint) and the slider: a telescope, a column, the mast of a lift. It is a beam along the joint's axis, fixed at the
    origin of the frame before, so that it bends by more the farther the slider is out. Each piece of it of length dx turns by
    dtheta = C M dx, where M, N m, is the moment of the slider's load at that piece, and C M = c_a (M . a) a + c_b (M . b) b +
    c_ab ((M . b) a + (M . a) b) as in ``bearing_compliance``. The modulation: c depends on the load and on the place along
    the travel, as the inner parts of a telescope are thinner.
    Parameters: ``bending``, the mean of c_a and c_b, positive where the structure bends in the direction of the load;
    ``difference``, c_a less c_b; ``skew``, c_ab; ``stiffening``: by how much ``bending`` increases when the moment on the
    slider becomes twice the usual one; ``drawn_out``: by how much from the middle of the fit's commands to their upper end. All
    are in 1/(N m^2).

    Typical sizes: ``along`` 5e-8 m/N (20 N/um), ``across_a`` and ``across_b`` 3e-8 m/N, ``roll``, ``tip_a`` and
    ``tip_b`` 5e-7 rad/(N m): guesses for rack, gear and servo in series with a stiffer carriage. Dressler et al. 2010,
    section V, assumes a lack of stiffness of cart 2. Where the usual force of the rods is below 60 N, the sizes are larger in
    inverse proportion: light machines have belts.
    """

    id = "cart_compliance"
    title = "cart deflection under load"
    clause = "{site} moves and tilts under the forces of its links"
    of_chains = ChainWords(
        clause="the structure of {site} bends under load, by more the farther it is out",
        remedy="Use the corrected model with the payload given; stiffen the column, or work with it drawn in.",
    )
    remedy = "Check carriage preload and pinion stiffness; use the corrected model with the payload given."
    coefficient = ("along", "m/N")
    acts_at = staticmethod(slides)
    depends_on = ("load", "payload")
    exported_as = "cart_springs"
    load = "moment across the axis"
    core = (0, 1, 2, TIPS, TIPS + 1, TIPS + 2)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "along": ParameterRange(0.0, np.inf, "no cart moves against its links' pull"),
        "bending": ParameterRange(0.0, np.inf, "no structure bends against its load"),
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | str | None:
        return no_load(at) if joints(at.robot) and not at.joint_loads.any() else super().untestable(at, site)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        if joints(at.robot):
            return _of_column(at, site)
        j = at.robot.sites.index(site)
        frame = joint_frame(at, site)
        rods, axes = list(frame.on_cart), np.vstack([frame.axis, frame.across])
        force, moment = cart_load(at, site)
        # Relative to the load of the fit, so that a prediction does not depend on which poses are predicted together.
        mean, spread = at.references.force
        usual = max(float(np.sqrt((mean[rods] ** 2 + spread[rods] ** 2).sum())), 1e-9)
        harder = np.linalg.norm(force, axis=1) / usual - 1.0
        softer = [(wave(at.travel[:, j], k), MODULATION.places / k) for k in range(1, PLACES + 1)]
        # Smaller, and with long waves only: otherwise the effect could be confused with a twist of the track.
        tips_softer = [(place, MODULATION.tipping * share) for place, share in softer[:2]]
        came = approach(at, j)
        # Half of the usual pull along each axis, N: that of the rods' usual forces in their mean directions.
        (mean, spread), parts = at.references.force, at.references.direction[0][rods] @ axes.T
        pull = np.abs(mean[rods] @ parts) + np.sqrt((spread[rods] ** 2) @ parts**2)
        small = np.maximum(pull / 2.0, 1e-9)
        columns, sizes = [], []
        always, stiffening = (np.ones(len(at)), 1.0), MODULATION.stiffening
        for factor, share in [always, (harder, stiffening), (came, MODULATION.friction), *softer]:
            for axis, size in zip(axes, GIVE, strict=True):
                # Friction depends on the magnitude of the pull.
                along = np.abs(force @ axis) if factor is came else force @ axis
                columns.append(np.outer(factor * along, [*axis, 0.0, 0.0, 0.0]))
                sizes.append(share * size)
        for axis, size, least in zip(axes, GIVE, small, strict=True):
            along = force @ axis
            columns.append(np.outer(along / np.sqrt(1.0 + (along / least) ** 2), [*axis, 0.0, 0.0, 0.0]))
            sizes.append(MODULATION.dead_zone * size)
        if len(rods) > 1:
            strength = np.linalg.norm(moment, axis=1)
            for factor, share in [always, (strength / (LEVER * usual) - 1.0, stiffening), *tips_softer]:
                for axis in axes:
                    columns.append(np.outer(factor * (moment @ axis), [0.0, 0.0, 0.0, *axis]))
                    sizes.append(share * TIP)
        return of_body(at, site, np.stack(columns, axis=2), unit(sizes, flexibility(at)))

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        if not joints(robot):
            return self.parameters(coefficients, shape_parameter)
        a, b, skew, harder, out = (float(c) for c in coefficients)
        found = {"bending": (a + b) / 2.0, "difference": a - b, "skew": skew, "stiffening": harder, "drawn_out": out}
        return {name: (value, "1/(N m^2)") for name, value in found.items()}

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        names = {"along": 0, "across_a": 1, "across_b": 2, "stiffening": 3}
        found = {name: (float(coefficients[i]), "m/N") for name, i in names.items()}
        tips = coefficients[TIPS : TIPS + 3]
        return found | {n: (float(c), "rad/(N m)") for n, c in zip(("roll", "tip_a", "tip_b"), tips, strict=False)}


FLEXIBILITY = 1e-5
"""Typical flexibility of a structure in bending, 1/(N m^2): as that of a link (``link_compliance``)."""


def _of_column(at: OperatingPoints, site: str) -> Displacement:
    """Basis of the bending of the structure between the joint before a sliding one and its slider.

    With x along the axis from the origin of the joint's placement frame, where the load is F and M, the moment at a piece is
    M - x u x F. The piece turns by dtheta about its own place, which moves the frame's origin by x u x dtheta. Both are
    integrated from the root, where the joint before is, to the slider. Stages of a telescope that follow one drive are beams
    of their own.
    """
    j, model = at.robot.sites.index(site), at.robot.model
    sizes = [1.0, 1.0, 1.0, MODULATION.stiffening, MODULATION.extension]
    moved = []
    for joint_id, ratio in at.robot.carriers(j):
        place, u, index = model.jointPlacements[joint_id], own_axis(at.robot, joint_id), frame_of_joint(joint_id)
        across, load = rotation_axes(u)[:2], at.joint_loads[:, index]
        root = -float(u @ place.rotation.T @ place.translation)
        slider = ratio * at.q[:, j] + at.robot.offset(joint_id)
        mean, spread = (values[index, 3:] for values in at.references.joints)
        usual = max(float(np.linalg.norm(across @ mean) + np.linalg.norm(across @ spread)), 1e-9)
        moment, lever = load[:, 3:] @ across.T, np.cross(u, load[:, :3]) @ across.T
        out = np.sign(slider - root)
        first, second, third = (out * (slider**k - root**k) / k for k in (1, 2, 3))
        turn = symmetric(moment * first[:, None] - lever * second[:, None]) @ across
        bend = symmetric(moment * second[:, None] - lever * third[:, None]) @ across
        a, b, skew = np.swapaxes(np.concatenate([np.cross(u, bend), turn], axis=2), 0, 1)
        bent, harder = a + b, np.linalg.norm(moment, axis=1)[:, None] / usual - 1.0
        moved.append((index, np.stack([a, b, skew, harder * bent, at.travel[:, [j]] * bent], axis=2)))
    return Displacement(unit(sizes, FLEXIBILITY), placements=tuple(moved))
