"""Links: they change their length or bend under load, and grow with heat; their joints have play, and are not round."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import ClassVar

import numpy as np

from gtpin.effects.chain_motions import beam, bending, lengthened, load_frame, of_tips, tip_loads, torsion
from gtpin.effects.displacement import Displacement, along_track, of_lengths, rods_of
from gtpin.effects.effect import ChainWords, Effect, ParameterRange, Parameters, unit
from gtpin.effects.joints import loaded, no_load
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import arm_and_links, links, links_at, loaded_along
from gtpin.effects.smooth import approach, drive_sizes, flexibility, loads_of, wave
from gtpin.effects.untestable import Untestable
from gtpin.robot.chain import Chain
from gtpin.typing import Floats

LINKS = 6
"""Number of links at the site ``arm``."""


class LinkCompliance(Effect):
    """dL = c F; dL is the change of a rod's length, m, and F its axial force, N, tension positive.

    The forces are computed with the closures' Jacobian from the weights of plate, links and payload, and from the force on
    the tool. The modulation: c depends on the load, and differs between tension and compression. Friction in the joints
    causes hysteresis. At ``arm`` each link differs a little from the others. The compliance of a leg of variable length
    depends on its length.

    Parameters: ``compliance`` c, m/N, at ``arm`` the mean of all links; ``stiffening``: by how much c increases, m/N,
    when the force becomes twice the usual one, negative where the link becomes stiffer (the usual force is the absolute mean
    over the poses of the fit plus one standard deviation); ``tension_less_compression``: c in tension less c in compression,
    m/N; ``hysteresis``: c less its mean, m/N, where the link's actuator moved towards larger commands before it stopped; at
    ``arm`` ``spread``: the standard deviation of c between the links, m/N; for legs of variable length ``drawn_out``: by how
    much c increases, m/N, from the middle of the leg's range to its upper end.

    A link of a robot without rods bends and twists as a beam of length l, m, along the unit vector u from its joint to the
    next joint. The beam is fixed at its root. F, N, and M, N m, are the force and moment on its tip. The motion of the tip,
    m and rad, is shift = f F l^3 / 3 + f (M x u) l^2 / 2 and turn = f (u x F) l^2 / 2 + f M l for the components of F and M
    across u, and turn = g M l for the component of M along u (Euler-Bernoulli bending and Saint-Venant torsion: see
    :mod:`gtpin.effects.chain_motions`). A link whose two joints meet in one point, as in a wrist, is a beam along its own axis
    that ends in this point, twice as long as the distance of its centre of mass from there. Parameters: ``bending``
    f = 1 / (E I), positive where the link bends in the direction of the load; ``torsion`` g = 1 / (G J); ``stiffening``: by how
    much f increases when the force becomes twice the usual one.
    All are in 1/(N m^2); at ``arm`` they are the same for all links.

    Typical size of ``bending`` 1e-5 1/(N m^2): an aluminium tube of 0.1 m diameter and 4 mm wall has
    E I = 70e9 * 3.14 * 0.05^3 * 0.004 = 1.1e5 N m^2, and G J is three quarters of E I. The links of a robot whose moving mass
    times length from base to TCP is below 15 kg m (a Panda has 18, a UR5 21) are more flexible in inverse proportion to this
    product: between robots of one shape and material both E I and the product grow with the fourth power of the size.

    Typical size of ``compliance`` 4e-8 m/N (25 N/um). A steel tube of 2.04 m and 5 cm^2 has L / (E A) = 2.04 / (210e9 *
    5e-4) = 1.9e-8 m/N; the rest, for two ball joints, is a guess. Where the usual force of the rods is below 60 N, the size is
    larger in inverse proportion. The attribute ``link`` of ``<compliance>`` in the URDF gives another size.
    """

    id = "link_compliance"
    title = "link deflection under load"
    clause = "{site} stretches under load"
    plural_clause = "{site} stretch under load"
    of_chains = ChainWords(
        clause="{site} bends under load",
        plural="{site} bend under load",
        remedy="Use the corrected model with the payload given; check the links' masses in the URDF.",
    )
    remedy = "Check links and their joints for stiffness; use the corrected model with the payload given."
    coefficient = ("compliance", "m/N")
    acts_at = staticmethod(arm_and_links)
    depends_on = ("load", "payload")
    exported_as = "link_spring"
    load = "force and moment of the link"
    core = (0,)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "compliance": ParameterRange(0.0, np.inf, "no link gets shorter when it is pulled"),
        "bending": ParameterRange(0.0, np.inf, "no link bends against its load"),
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | str | None:
        return None if at.joint_loads.any() else no_load(at)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        if not links(at.robot):
            return _of_beams(at, site)
        rods = rods_of(at, site)
        force = at.force[:, rods]
        mean, spread = at.references.force
        usual = np.maximum(np.abs(mean[rods]) + spread[rods], 1e-9)
        came = np.stack([approach(at, at.robot.rod(i).driver) for i in rods], axis=1)
        columns = [force, force * (np.abs(force) / usual - 1.0), np.abs(force) / 2.0, force * came]
        sizes = [1.0, MODULATION.stiffening, MODULATION.compression, MODULATION.friction]
        if len(rods) > 1:
            columns += [force * (np.arange(len(rods)) == i) for i in range(len(rods))]
            sizes += [MODULATION.links] * len(rods)
        legs = np.array([at.robot.rod(i).extension for i in rods])
        if None not in legs:
            columns.append(force * at.travel[:, legs.astype(int)])
            sizes.append(MODULATION.extension)
        return of_lengths(at, rods, np.stack(columns, axis=2), unit(sizes, _compliance(at)))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        own = coefficients[4 : 4 + LINKS] if len(coefficients) >= 4 + LINKS else coefficients[:0]
        drawn = coefficients[4 + len(own) :]
        names = ("compliance", "stiffening", "tension_less_compression", "hysteresis")
        found = dict(zip(names, (float(c) for c in coefficients[:4]), strict=True))
        if own.size:
            found["compliance"] += float(own.mean())
            found["spread"] = float(own.std())
        if drawn.size:
            found["drawn_out"] = float(drawn[0])
        return {name: (value, "m/N") for name, value in found.items()}

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        if links(robot):
            return self.parameters(coefficients, shape_parameter)
        return {name: (float(c), "1/(N m^2)") for name, c in zip(BEAM, coefficients, strict=False)}


COMPLIANCE = 4e-8
"""Typical compliance of a rod of a heavy machine, m/N: see :class:`LinkCompliance`."""


def _compliance(at: OperatingPoints) -> float:
    """Typical compliance of a robot's rods, m/N: that of its URDF, where given."""
    given = at.robot.description.link_compliance
    return COMPLIANCE * flexibility(at) if given is None else given


FLEXIBILITY, MEDIUM = 1e-5, 15.0
"""Typical flexibility of a beam in bending, 1/(N m^2), and mass times length of a robot, kg m, below which it is larger: see
:class:`LinkCompliance`."""
BEAM = ("bending", "torsion", "stiffening")


def _of_beams(at: OperatingPoints, site: str) -> Displacement:
    """Basis with three columns: bending, torsion, and the dependence of bending on the load."""
    twists = []
    for link in links_at(at.robot, site):
        length, loads = beam(at, link), tip_loads(at, link)
        mean, spread = (values[load_frame(at.robot, link)] for values in at.references.joints)
        usual = max(float(np.linalg.norm(mean[:3]) + np.linalg.norm(spread[:3])), 1e-9)
        bent = bending(length, loads)
        harder = np.linalg.norm(loads[:, :3], axis=1, keepdims=True) / usual - 1.0
        twists.append(np.stack([bent, torsion(length, loads), harder * bent], axis=2))
    return of_tips(at, site, twists, unit([1.0, 1.3, MODULATION.stiffening], _flexibility(at.robot)))


def _flexibility(robot: Chain) -> float:
    """Typical size of a beam's flexibility on a robot, 1/(N m^2)."""
    model = robot.model
    mass = sum(float(inertia.mass) for inertia in list(model.inertias)[1:])
    way = [model.jointPlacements[j] for j in list(model.supports[robot.tcp_joint])[2:]]
    length = sum(float(np.linalg.norm(placement.translation)) for placement in [*way, robot.tcp_placement])
    return FLEXIBILITY * max(1.0, MEDIUM / (mass * length)) if mass * length > 0.0 else FLEXIBILITY


class ThermalLinks(Effect):
    """dL = alpha L (temp_link - reference): a warm link is longer where alpha > 0.

    L is the link's length, m, and dL its change. The reference is the dataset's ``reference_temperature``, degC. The
    modulation: alpha changes with time, because the sensor does not measure the link itself, and with the temperature
    difference. At ``arm`` each link differs a little from the others. A link of a robot without rods, also one that only loops
    move, expands in proportion: the joints, the TCP and the anchors of loops on it move away from its own joint.

    Parameters: ``expansion`` alpha, 1/K, at ``arm`` the mean of all links; at ``arm`` ``spread``: the standard deviation of
    alpha between the links, 1/K.

    Typical size: alpha 8e-6 / K, between carbon fibre (-1e-6 to 1e-6) and steel (12e-6) or aluminium (23e-6); of robots
    without rods 1.5e-5 / K.
    """

    id = "thermal_links"
    title = "thermal growth of links"
    clause = "{site} grows with its temperature"
    plural_clause = "{site} grow with their temperature"
    remedy = "Let the machine warm up, or use the corrected model with the links' temperature measured."
    coefficient = ("expansion", "1/K")
    acts_at = staticmethod(arm_and_links)
    needs = ("temp_link",)
    uses = ("time",)
    core = (0,)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "expansion": ParameterRange(
            -2e-6, 1e-4, "of link materials only carbon fibre shrinks with heat, by 1e-6/K; plastics expand by 1e-4/K"
        )
    }
    expected_range: ClassVar[Mapping[str, ParameterRange]] = {
        "expansion": ParameterRange(
            4e-6, 3.5e-5, "steel has 12e-6/K, and few links have a third or three times as much"
        )
    }

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        warm = at.covariate("temp_link") - at.references.temperature
        common = np.stack([warm, warm * np.abs(warm) / 5.0, warm * at.lateness], axis=1)
        rods = len(rods_of(at, site))
        own = rods if rods > 1 else 0
        strain = np.repeat(common[:, None], rods or len(links_at(at.robot, site)), axis=1)
        strain = np.concatenate([strain, warm[:, None, None] * np.eye(strain.shape[1])[None, :, :own]], axis=2)
        sizes = [1.0, MODULATION.warming, MODULATION.late, *[MODULATION.links] * own]
        return lengthened(at, site, strain, unit(sizes, 8e-6 if rods else 1.5e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        own = coefficients[3:]
        if not own.size:
            return {"expansion": (float(coefficients[0]), "1/K")}
        return {"expansion": (float(coefficients[0] + own.mean()), "1/K"), "spread": (float(own.std()), "1/K")}


FEWEST_OF_SIGN = 2
"""Smallest number of poses with the rarer sign of the force: a single pose can't be distinguished from a gross error."""


class JointClearance(Effect):
    """dL = c sign(F); dL is the change of the link's length, m, and F its axial force, N, tension positive.

    In tension the link is longer by c than in the middle of the play. In compression it is shorter by c. The modulation: where
    the force is small, the ball can be anywhere within the play; under larger forces the socket also deforms.

    At a joint of a robot without rods: dq = c sign(M). dq is the deviation of the joint from its command, rad or m. M is the
    moment about the joint's axis, N m, or the force along it, N, positive towards larger commands. The sign of the load
    decides at which side of the play the joint rests. Where the direction of approach decides it, the effect is ``backlash``.

    Parameters: ``half_play`` c, m, positive for real play; ``play`` = 2 c, m; ``yielding``, m: further change of length,
    beyond the play, when the force changes by one spread. The spread is the standard deviation over the poses of the fit; at a
    joint of a robot without rods, the absolute mean is added to it. Where a joint turns, the parameters are in rad.

    Typical size: c 15 um, a guess for a worn ball joint; new ones are preloaded. At a turning joint of a robot without
    rods 0.15 mrad.
    """

    id = "joint_clearance"
    title = "joint play"
    clause = "a joint of {site} has play"
    of_chains = ChainWords(
        clause="{site} has play, which its load takes up", remedy="Replace the gear or bearing, or preload it."
    )
    remedy = "Replace or preload the joint."
    coefficient = ("half_play", "m")
    acts_at = staticmethod(loaded_along)
    depends_on = ("load",)
    core = (0,)
    of_travel = True
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "half_play": ParameterRange(0.0, np.inf, "play makes a link longer in tension, not shorter")
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | None:
        if not loaded(at, site):
            return no_load(at)
        pulled = int((loads_of(at, site)[0] > 0.0).sum())
        return None if min(pulled, len(at) - pulled) >= FEWEST_OF_SIGN else Untestable("one_sign")

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        rods, (load, mean, spread) = rods_of(at, site), (values[..., 0] for values in loads_of(at, site))
        scale, sign = spread if rods else np.maximum(np.abs(mean) + spread, 1e-9), np.sign(load)
        columns = np.stack([sign, np.tanh(load / (0.2 * scale)) - sign, load / scale], axis=1)
        sizes = drive_sizes(at, site, [1.0, MODULATION.soft_clearance, MODULATION.yielding], 1.5e-5)
        return of_lengths(at, rods, columns[:, None], sizes) if rods else along_track(at, site, columns, sizes)

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        half, yielding = float(coefficients[0]), float(coefficients[2])
        return {"half_play": (half, "m"), "play": (2.0 * half, "m"), "yielding": (yielding, "m")}


ORDERS = [(m, n) for m, n in product(range(6), repeat=2) if 1 <= m + n <= 5]
"""Orders (m, n) of the products of cosines over the two angles of a link."""
FARTHEST = 2.5
"""Angle at which a cosine of order 1 has an extreme value, over the spread of the directions in the fit."""


def _roundness() -> Floats:
    """(m, m) quadratic form of the coefficients: mean square of f about the best sphere, over a cone of directions."""
    radius, turn = np.sqrt(2.0 * (np.arange(20) + 0.5) / 20) / FARTHEST, 2.0 * np.pi * np.arange(24) / 24
    a, b = np.outer(radius, np.cos(turn)).ravel(), np.outer(radius, np.sin(turn)).ravel()
    sphere = np.linalg.qr(np.stack([np.ones_like(a), a, b, a**2 + b**2], axis=1))[0]
    waves = np.stack([wave(a, m) * wave(b, n) for m, n in ORDERS], axis=1) / np.sqrt(len(a))
    waves -= sphere @ (sphere.T @ waves)
    return np.asarray(waves.T @ waves)


_ROUNDNESS = _roundness()


class JointRunout(Effect):
    """dL = f(a, b); dL is the change of the link's length, m, positive where it is longer.

    a and b are the two small angles, rad, between the link and its mean direction over the poses of the fit. f is a sum of
    products of cosines. Cosines of long wavelength have larger typical sizes. Geometry absorbs the part of f that is constant
    or linear in the angles.

    Parameters: ``rms``, m: root mean square of f about the best sphere, whose radius and centre geometry absorbs, over a cone
    of directions with the spread of those in the fit.

    Typical size: root mean square of f 15 um. Balls of grade 100 are round to 2.5 um, of grade 200 to 5 um (ISO 3290);
    machined or worn sockets are less round.
    """

    id = "joint_runout"
    nature = "profile"
    title = "out-of-round ball"
    clause = "a ball of {site} is out of round"
    remedy = "Have the ball and its socket measured, or replaced."
    coefficient = ("first_wave", "m")
    acts_at = staticmethod(links)
    depends_on = ("direction",)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        i = rods_of(at, site)[0]
        a, b = (np.clip(at.tilt[:, i, c] / FARTHEST, -1.5, 1.5) for c in (0, 1))
        waves = [wave(a, m) * wave(b, n) for m, n in ORDERS]
        size = np.array([(m + n) ** -1.2 for m, n in ORDERS])
        size *= 2.0 / np.linalg.norm(size)
        return of_lengths(at, [i], np.stack(waves, axis=1)[:, None, :], unit(size, 1.5e-5))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        return {"rms": (float(np.sqrt(coefficients @ _ROUNDNESS @ coefficients)), "m")}
