"""Orientations that positions do not determine are told with the error of machines that the tests' own equations close."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from circle_machines import Floats, of_rods
from drawn_machines import told
from scipy.spatial.transform import Rotation

import gtpin


def turned(model: gtpin.Model, T: Floats, R: Floats, q: Floats) -> float:
    """Mean square error of a model's orientations, rad^2, where it is placed as the positions T say."""
    poses = model.kinematics.forward(q)
    place, _ = Rotation.align_vectors(T - T.mean(axis=0), poses.T - poses.T.mean(axis=0))
    off = Rotation.from_matrix(R).inv() * place * Rotation.from_matrix(poses.R)
    return float((off.as_rotvec() ** 2).sum(axis=1).mean())


@pytest.mark.slow
def test_the_error_of_orientations_is_told_where_positions_do_not_determine_them(tmp_path: Path) -> None:
    said, true = [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        machine = of_rods("linear_delta", "", rng)
        model = gtpin.calibrate(machine.dataset(rng, tmp_path)).model
        q = machine.commands(rng, 100)
        true.append(turned(model, *machine.poses(q), q))
        text = " ".join(told(model, tmp_path / "robot.urdf"))
        said.append(1e-3 * float(re.findall(r"orientations that the data do not determine: .* (\S+) mrad", text)[0]))
    assert np.sqrt(np.mean(true)) == pytest.approx(np.sqrt(np.mean(np.square(said))), rel=0.5)
