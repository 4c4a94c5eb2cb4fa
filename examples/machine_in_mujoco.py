"""A diagnosed machine in MuJoCo with the nominal robot. Needs `pip install ".[mujoco]"`; `--view` opens the viewer."""

import sys

import mujoco
import numpy as np

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.compensation import machine_of
from gtpin.export import export
from gtpin.sim import commands_for_simulator

# In the place of your measurements:
case = make_case(4, effects=[("backlash", "cart1")], noncentrality=2000.0, poses=80)
machine = machine_of(gtpin.diagnose(case.dataset).model)

# What a controller sends, and the conditions that the effects of the machine depend on.
q = np.array([0.20, -0.05, 0.10]) + 0.05 * np.sin(np.linspace(0.0, 2.0 * np.pi, 9))[:, None]
around = {name: column[: len(q)] for name, column in case.commands.covariates.items()}
around["approach1"] = np.sign(np.gradient(q[:, 0]))
given = commands_for_simulator(machine, q, around)

nominal = gtpin.read_model("gantry_tau")
errors = np.linalg.norm(given.poses.minus(nominal.predict(q))[:, :3], axis=1)
export(nominal, "gantry_tau.xml")
model = mujoco.MjModel.from_xml_path("gantry_tau.xml")
data = mujoco.MjData(model)
tcp = model.body(nominal.robot.tcp_frame).id
place, turn = model.body_pos[tcp].copy(), np.zeros(9)
mujoco.mju_quat2Mat(turn, model.body_quat[tcp])


def run(viewer: object = None) -> None:
    mujoco.mj_resetDataKeyframe(model, data, 0)
    before = data.ctrl.copy()
    for row, command in enumerate(given.q):
        # The offset of the TCP on the platform, which three commands can't show.
        model.body_pos[tcp] = place + turn.reshape(3, 3) @ given.offset.T[row]
        mujoco.mju_mat2Quat(model.body_quat[tcp], (turn.reshape(3, 3) @ given.offset.R[row]).ravel())
        for step in range(800):
            data.ctrl[:] = before + min(1.0, (step + 1) / 400) * (command - before)
            mujoco.mj_step(model, data)
            if viewer is not None:
                viewer.sync()
        before = command
        mujoco.mj_kinematics(model, data)
        off = np.linalg.norm(data.xpos[tcp] - given.poses.T[row])
        print(f"command {row + 1}: the machine is {1e6 * errors[row]:.0f} um off, shown to {1e6 * off:.2f} um")
        assert off < 2e-6


if "--view" in sys.argv:
    import mujoco.viewer

    with mujoco.viewer.launch_passive(model, data) as window:
        run(window)
else:
    run()
