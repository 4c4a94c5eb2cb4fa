"""The error of the nominal robot is that after the best fit of positions, where the frame of the instrument is free."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from quick_first import quick_first
from scipy.spatial.transform import Rotation
from virtual_gantry import GANTRY, commands, draw, measured
from virtual_instruments import Seen, read

import gtpin


@pytest.mark.parametrize(("schema", "orientation"), quick_first([(1, True), (2, False), (1, False), (2, True)], 2))
def test_no_rigid_motion_of_the_nominal_positions_is_nearer(schema: int, orientation: bool, tmp_path: Path):
    rng = np.random.default_rng(8)
    machine, q = draw(rng, free=True), commands(rng, 80)
    dataset = measured(machine, q, rng, orientation=orientation)
    if schema == 2:
        columns = dict(zip("xyz", dataset.position.T, strict=True))
        if dataset.orientation is not None:
            columns |= dict(zip(("qw", "qx", "qy", "qz"), dataset.orientation.T, strict=True))
        said = {"name": "laser", "kind": "tracker", "frame": "free", "sigma": dataset.instrument.position_sigma}
        dataset = read(tmp_path, Seen(said, q, columns))
        columns = dataset.readings.columns
        T = np.column_stack([columns[axis] for axis in "xyz"])
    else:
        T = dataset.position
    nominal = GANTRY.poses(dataset.q)[0]
    a, b = nominal - nominal.mean(axis=0), T - T.mean(axis=0)
    best = np.sqrt(((Rotation.align_vectors(b, a)[0].apply(a) - b) ** 2).sum(axis=1).mean())
    found = gtpin.calibrate(dataset)
    assert found.rejected == ()
    assert found.by_instrument[0].before == pytest.approx(best, rel=1e-3)
    assert found.to_json()["position_rms_before"] == pytest.approx(best, rel=1e-3)
    assert "nominal geometry after the best fit of the frame" in " ".join(str(found.summary()).split())
