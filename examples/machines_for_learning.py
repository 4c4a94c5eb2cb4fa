"""An environment like Gymnasium's with another diagnosed machine in each episode. Needs `pip install ".[mujoco]"`."""

import mujoco
import numpy as np

import gtpin
from gtpin.bench.simulator import make_case
from gtpin.export import export
from gtpin.sim import Diagnosed


class Reach:
    """Bring the TCP to a goal; actions are commands q, observations the TCP's position and the goal."""

    def __init__(self) -> None:
        export(gtpin.read_model("gantry_tau"), "gantry_tau.xml")
        self.model = mujoco.MjModel.from_xml_path("gantry_tau.xml")
        self.data = mujoco.MjData(self.model)
        self.goal = np.zeros(3)

    def reset(self, seed: int | None = None) -> tuple[np.ndarray, dict[str, object]]:
        mujoco.mj_resetDataKeyframe(self.model, self.data, 0)
        mujoco.mj_forward(self.model, self.data)
        self.goal = self._tcp() + np.random.default_rng(seed).uniform(-0.1, 0.1, 3)
        return np.concatenate([self._tcp(), self.goal]), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, object]]:
        before = self.data.ctrl.copy()
        for step in range(800):
            self.data.ctrl[:] = before + min(1.0, (step + 1) / 400) * (action - before)
            mujoco.mj_step(self.model, self.data)
        distance = float(np.linalg.norm(self._tcp() - self.goal))
        return np.concatenate([self._tcp(), self.goal]), -distance, distance < 2e-5, False, {}

    def _tcp(self) -> np.ndarray:
        return self.data.body("tcp").xpos.copy()


# In the place of your measurements:
case = make_case(4, effects=[("backlash", "cart1")], noncentrality=2000.0, poses=80)
diagnosed = gtpin.diagnose(case.dataset).model
rng = np.random.default_rng(0)
conditions = {"time": 0.0, "session": "1", "payload": 0.0, "temp_frame": 20.0, "temp_link": 20.0}
environment = Diagnosed(Reach(), diagnosed.sample(50, rng), rng, conditions=conditions)

nominal = gtpin.read_model("gantry_tau").kinematics
for episode in range(3):
    observation, _ = environment.reset(seed=episode)
    q, _ = gtpin.commands_for(nominal, observation[None, 3:])  # what a controller with the nominal model sends
    _, reward, *_ = environment.step(q[0])
    print(f"episode {episode + 1}: the nominal controller misses by {-1e3 * reward:.2f} mm")
    assert 2e-5 < -reward < 2e-2
