"""Export a calibrated robot to MuJoCo, move it there, and compare its pose with gtpin's. Needs `pip install ".[mujoco]"`."""

import mujoco
import numpy as np

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.export import export

robot = gtpin.load_robot("gantry_tau")
calibrated = gtpin.calibrate(simulate(robot, "gantry_tau", poses=80, seed=2).dataset).model

export(calibrated, "gantry_tau.xml")  # .urdf and .sdf likewise
model = mujoco.MjModel.from_xml_path("gantry_tau.xml")
data = mujoco.MjData(model)
print(f"{model.nbody} bodies, {model.neq} loops closed by equality/connect, {model.nu} position actuators")

mujoco.mj_resetDataKeyframe(model, data, 0)  # home, all loops closed
home, q = data.ctrl.copy(), np.array([0.10, -0.05, 0.20])
for step in range(3000):
    data.ctrl[:] = home + min(1.0, (step + 1) / 150) * (q - home)
    mujoco.mj_step(model, data)
    if step > 180 and np.abs(data.qvel).max() < 1e-7:
        break
mujoco.mj_kinematics(model, data)

there = data.xpos[model.body(robot.tcp_frame).id]
expected = calibrated.predict(q[None]).T[0]
print(f"at rest after {data.time:.2f} s: TCP at {there}, {np.linalg.norm(there - expected) * 1e9:.1f} nm from gtpin's")
assert np.linalg.norm(there - expected) < 1e-5
