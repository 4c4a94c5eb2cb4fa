"""The machines of examples/independent: nominal poses and loads are those of gtpin, which they share no code with."""

import runpy
from pathlib import Path

import numpy as np
import pinocchio
import pytest

import gtpin

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["gantry_tau", "five_bar", "ur5", "xarm7"])
def test_nominal_poses_and_loads_are_those_of_the_chain(name: str, tmp_path: Path) -> None:
    code = runpy.run_path(str(ROOT / "examples/independent/machines.py"))
    share = Path(pinocchio.__file__).parents[4] / "share/example-robot-data/robots"
    machine = code["machines"](share, ROOT / "urdf/gantry_tau.urdf")[name]
    robot = name
    if name == "five_bar":
        (tmp_path / "five_bar.urdf").write_text(machine.text)
        robot = str(tmp_path / "five_bar.urdf")
    chain = gtpin.load_robot(robot)
    q = machine.lower + (machine.upper - machine.lower) * np.random.default_rng(0).uniform(0.4, 0.6, (4, machine.n))
    T, R = machine.poses(q, np.zeros(len(machine.tolerance)), code["Deviation"]())
    poses = chain.forward(q)
    np.testing.assert_allclose(T, poses.T, atol=1e-12)
    np.testing.assert_allclose(R, poses.R, atol=1e-12)
    holding = chain.inverse_dynamics(q, 0 * q, 0 * q, payload=1.5)
    loads = machine.loads(q, np.full(4, 1.5)).drive
    if name == "gantry_tau":  # the carts' own weight along their tracks is no load of the links
        holding = holding - holding.mean(axis=0)
        loads = loads - loads.mean(axis=0)
    np.testing.assert_allclose(loads, -holding, atol=1e-6 * np.abs(holding).max())
