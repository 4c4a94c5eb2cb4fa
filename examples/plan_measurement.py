"""Plan the next measurement: the poses that determine the geometry best, and those that distinguish two possible causes."""

import numpy as np

import gtpin
from gtpin.accuracy.planning import plan_poses
from gtpin.accuracy.workspace import default_commands
from gtpin.bench.simulator import make_case
from gtpin.noise.noise import Noise

# Before the first measurement: 25 of 180 poses, for a tracker of 15 um and 50 urad.
model = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")))
q = default_commands(model)
plan = plan_poses(model, q, 25, Noise(1.5e-5, 5e-5), at=q, draws=20)
print(f"the best 25 poses tell {plan.nats:.0f} nats, 25 at random {plan.random_nats.mean():.0f}")
print(f"error after calibration {plan.error * 1e6:.0f} um, at random {plan.random_error.mean() * 1e6:.0f} um")
gtpin.Commands(np.arange(25).astype(str).astype(object), q[plan.rows]).write("plan.csv")
print("written: plan.csv, first commands", q[plan.rows][0])

# After a diagnosis: what would settle what it left open.
case = make_case(8, effects=[("straightness", "cart1")], noncentrality=150.0, poses=80)  # weak: a few rivals are likely
diagnosis = gtpin.diagnose(case.dataset)
print("verdict:", diagnosis.verdict, *(f"{m.effect}@{m.site}" for c in diagnosis.causes for m in c.members))
for experiment in diagnosis.next_experiment[:3]:
    print("-", experiment.measure)
    print("  separates", ", ".join(experiment.separates), "with", len(experiment.poses), "poses")
