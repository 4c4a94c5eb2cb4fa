"""Identify a geometry from measured poses, list what the data do not determine, and check it on poses that were not fitted."""

import numpy as np

import gtpin
from gtpin.bench.simulator import (
    simulate,  # a machine drawn from its tolerances, and a noisy tracker: stands in for yours
)

machine = simulate(gtpin.load_robot("gantry_tau"), "gantry_tau", poses=120, seed=4)
machine.dataset.write("measured")  # dataset.toml and poses.csv, as your measurements would be
dataset = gtpin.Dataset.read("measured")

calibration = gtpin.calibrate(dataset)
print(f"chi-square per degree of freedom {calibration.chi2_per_dof:.2f}; set aside: {calibration.rejected or 'none'}")
for name, value, sigma, variance_reduction in list(
    zip(calibration.names, calibration.values, calibration.sigma, calibration.variance_reduction, strict=True)
)[:8]:
    print(f"{name:24} {value:10.6f} +- {sigma:.1e}   variance reduction {variance_reduction:.0%}")
print(f"{len(calibration.unobservable)} directions can't be told by these data; the first:")
print("  ", calibration.unobservable[0].weights)

nominal = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
for name, model in (("nominal", nominal), ("calibrated", calibration.model)):
    off = model.predict(machine.commands.q).T - machine.truth.T
    print(f"{name:10} {np.sqrt((off**2).sum(axis=1).mean()) * 1e6:8.1f} um RMS on poses that were not fitted")

gtpin.write_model(calibration.model, "calibrated")  # model.json and robot.urdf
again = gtpin.read_model("calibrated")
assert (again.predict(dataset.q).T == calibration.model.predict(dataset.q).T).all()
