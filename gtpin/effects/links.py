"""Links: they change their length or bend under load, and grow with heat."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gtpin.effects.chain_motions import beam, bending, lengthened, of_tips, tip_loads, torsion
from gtpin.effects.displacement import Displacement, of_lengths, rods_of
from gtpin.effects.effect import ChainWords, Effect, ParameterRange, Parameters, unit
from gtpin.effects.joints import no_load
from gtpin.effects.modulation import MODULATION
from gtpin.effects.operating_points import OperatingPoints
from gtpin.effects.sites import arm_and_links, links, links_at
from gtpin.effects.smooth import approach
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

    Typical size 4e-8 m/N, that is 25 N/um. A steel tube, 2.04 m long with a section of 5 cm^2, has L / (E A) =
    2.04 / (210e9 * 5e-4) = 1.9e-8 m/N. The two ball joints are assumed to have about as much together. For other links the
    attribute ``link`` of ``<compliance>`` in the URDF gives the typical size, m/N.

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
    core = (0,)
    plausible: ClassVar[Mapping[str, ParameterRange]] = {
        "compliance": ParameterRange(0.0, np.inf, "no link gets shorter when it is pulled"),
        "bending": ParameterRange(0.0, np.inf, "no link bends against its load"),
    }

    def untestable(self, at: OperatingPoints, site: str) -> Untestable | str | None:
        """``no_masses`` where no link carries a load."""
        return None if at.joint_loads.any() else no_load(at)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """The common compliance, then its modulation: load, tension or compression, friction, link, and length of a leg."""
        if not links(at.robot):
            return _of_beams(at, site)
        rods = rods_of(at, site)
        force = at.force[:, rods]
        mean, spread = at.references.force
        usual = np.maximum(np.abs(mean[rods]) + spread[rods], 1e-9)
        came = np.stack([approach(at, at.robot.rods[i].driver) for i in rods], axis=1)
        columns = [force, force * (np.abs(force) / usual - 1.0), np.abs(force) / 2.0, force * came]
        sizes = [1.0, MODULATION.stiffening, MODULATION.compression, MODULATION.friction]
        if len(rods) > 1:
            columns += [force * (np.arange(len(rods)) == i) for i in range(len(rods))]
            sizes += [MODULATION.links] * len(rods)
        legs = np.array([at.robot.rods[i].extension for i in rods])
        if None not in legs:
            columns.append(force * at.travel[:, legs.astype(int)])
            sizes.append(MODULATION.extension)
        return of_lengths(at, rods, np.stack(columns, axis=2), unit(sizes, at.robot.description.link_compliance))

    def parameters(self, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        whole, stiffening, pulled, held = (float(c) for c in coefficients[:4])
        own = coefficients[4 : 4 + LINKS] if len(coefficients) >= 4 + LINKS else coefficients[:0]
        drawn = coefficients[4 + len(own) :]
        mean = float(own.mean()) if own.size else 0.0
        found = {
            "compliance": (whole + mean, "m/N"),
            "stiffening": (stiffening, "m/N"),
            "tension_less_compression": (pulled, "m/N"),
            "hysteresis": (held, "m/N"),
        }
        found |= {"spread": (float(own.std()), "m/N")} if own.size else {}
        return found | ({"drawn_out": (float(drawn[0]), "m/N")} if drawn.size else {})

    def parameters_at(self, robot: Chain, site: str, coefficients: Floats, shape_parameter: float | None) -> Parameters:
        if links(robot):
            return self.parameters(coefficients, shape_parameter)
        return {name: (float(c), "1/(N m^2)") for name, c in zip(BEAM, coefficients, strict=False)}


FLEXIBILITY, MEDIUM = 1e-5, 15.0
"""Typical flexibility of a beam in bending, 1/(N m^2), and mass times length of a robot, kg m, below which it is larger: see
:class:`LinkCompliance`."""
BEAM = ("bending", "torsion", "stiffening")


def _of_beams(at: OperatingPoints, site: str) -> Displacement:
    """Basis with three columns: bending, torsion, and the dependence of bending on the load."""
    twists = []
    for link in links_at(at.robot, site):
        length, loads = beam(at, link), tip_loads(at, link)
        mean, spread = (values[link.tip] for values in at.references.joints)
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
    length = sum(float(np.linalg.norm(placement.translation)) for placement in [*way, robot.load_placement])
    return FLEXIBILITY * max(1.0, MEDIUM / (mass * length)) if mass * length > 0.0 else FLEXIBILITY


class ThermalLinks(Effect):
    """dL = alpha L (temp_link - reference): a warm link is longer where alpha > 0.

    L is the link's length, m, and dL its change. The reference is the dataset's ``reference_temperature``, degC. The
    modulation: alpha changes with time, because the sensor does not measure the link itself, and with the temperature
    difference. At ``arm`` each link differs a little from the others. A link of a robot without rods expands along the line
    from its joint to the next joint.

    Parameters: ``expansion`` alpha, 1/K, at ``arm`` the mean of all links; at ``arm`` ``spread``: the standard deviation of
    alpha between the links, 1/K.

    Typical size 8e-6 / K: larger than carbon fibre along the tube (-1e-6 to 1e-6 / K), smaller than steel (12e-6 / K) and
    aluminium (23e-6 / K; handbook values). For links of robots without rods 1.5e-5 / K.
    """

    id = "thermal_links"
    title = "thermal growth of links"
    clause = "{site} grows with its temperature"
    plural_clause = "{site} grow with their temperature"
    remedy = "Let the machine warm up, or use the corrected model with the links' temperature measured."
    coefficient = ("expansion", "1/K")
    acts_at = staticmethod(arm_and_links)
    needs = ("temp_link",)
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
        """The common expansion, then its modulation: temperature difference, time, and for robots with rods each link."""
        warm = at.covariate("temp_link") - at.references.temperature
        late = at.time if at.has("time") else np.zeros(len(at))
        common = np.stack([warm, warm * np.abs(warm) / 5.0, warm * late], axis=1)
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
