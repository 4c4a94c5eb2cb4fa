"""An effect of one's own: a cable chain that pulls a cart back, how far it moves the pose, and its exact use in a model."""

import numpy as np

import gtpin
from gtpin.effects import Effect, OperatingPoints, actuators, along_track
from gtpin.effects.active import ActiveEffect


class CableChain(Effect):
    """dq = -(p + r q) payload / 20 kg: the farther out, the more it pulls. Parameter: ``rate`` r, m/m."""

    id = "cable_chain"
    title = "a cable chain pulls the cart back"
    clause = "a cable chain pulls {site} back"
    coefficient = ("rate", "m/m")

    def sites(self, robot):
        return actuators(robot)

    def covariates(self, robot, site):
        return ("payload",)  # its hoses are full when it carries something

    def basis(self, at, site, shape_parameter=None):
        q, full = at.q[:, at.robot.sites.index(site)], at.covariate("payload") / 20.0
        columns = np.stack([-q * full, -full], axis=1)  # m of travel for coefficients of one
        return along_track(at, site, columns, np.array([5e-5, 2e-5]))  # and their typical sizes


# A diagnosis tries it with gtpin.diagnose(dataset, effects=[*gtpin.catalogue(), CableChain()]).
# To have the command `gtpin diagnose` try it too, a package of yours names it in its pyproject.toml:
#     [project.entry-points."gtpin.effects"]
#     cable_chain = "my_machine.effects:CableChain"

geometry = gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau"))
plain = gtpin.Model(geometry)
q = np.random.default_rng(0).uniform(-0.4, 0.4, (50, 3))
payload = np.tile([0.0, 20.0], 25)
at = OperatingPoints(plain.kinematics, q, plain.predict(q), {"payload": payload})

effect, coefficients = CableChain(), np.array([5e-5, 2e-5])
linear = effect.basis(at, "cart2").displacement(at) @ coefficients  # (N, 6) by the derivative
active = ActiveEffect(effect, "cart2", None, coefficients, np.zeros((2, 2)), at.references)
exact = gtpin.Model(geometry, effects=(active,)).predict(q, {"payload": payload}).minus(at.poses)
moved = np.linalg.norm(exact[:, :3], axis=1) * 1e6
print(
    f"moves the TCP by {moved[payload > 0].mean():.1f} um in the mean when loaded, {moved[payload == 0].max():.1f} um when not"
)
print(f"the derivative is off by {np.abs(linear - exact)[:, :3].max() * 1e9:.2f} nm at most")
