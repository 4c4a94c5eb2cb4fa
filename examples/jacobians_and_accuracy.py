"""Jacobians of a pose, and the error to expect from manufacturing tolerances over the workspace."""

import numpy as np

import gtpin
from gtpin.accuracy.dexterity import dexterity
from gtpin.accuracy.expected import Uncertainty, expected_error
from gtpin.accuracy.sensitivity import sensitivity
from gtpin.accuracy.workspace import default_commands

robot = gtpin.load_robot("gantry_tau")
home = gtpin.home(robot)
geometry = gtpin.Geometry.nominal(robot)

J = home.jacobian  # (6, 3): position and rotation vector by the carts
step = 1e-6
by_differences = (home.moved_to([step, 0.0, 0.0]).T - home.moved_to([-step, 0.0, 0.0]).T) / (2 * step)
print("dT/dq1", J[:3, 0], "by differences", by_differences)

G = gtpin.geometry_jacobian(home, geometry)  # (6, 48): by each parameter of the geometry
for name, column in sorted(zip(geometry.names, G.T, strict=True), key=lambda c: -np.linalg.norm(c[1][:3]))[:5]:
    print(f"1 mm or mrad of {name:26} moves the TCP by {np.linalg.norm(column[:3]):.2f} mm")

model = gtpin.Model(geometry)
q = default_commands(model, 60)  # commands that fill the workspace
print("worst condition number", dexterity(model, q).condition.max())

error = expected_error(model, q, Uncertainty(parameters=np.diag(geometry.tolerance**2)))
print(
    f"made to its tolerances: mean error {error.position.mean * 1e3:.1f} mm, 95 % below {error.position.p95 * 1e3:.1f} mm"
)

table = sensitivity(model, q)  # the paper's Table III for these poses
for rod, moved in zip(robot.rod_sites, table.exact.position[0], strict=True):
    print(f"length of {rod}: the TCP moves by {moved / (2 * len(q) * 5e-5):.2f} m/m in the mean")
