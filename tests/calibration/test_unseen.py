"""What readings can't see is said in words, and the measurement that is said to tell it does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import virtual_instruments
from closures import Closures
from scipy.spatial.transform import Rotation
from virtual_gantry import draw
from virtual_instruments import Seen, bed, level, read

import gtpin
from gtpin.calibration.observability import Remedy
from gtpin.report.calibration_text import unseen_words
from gtpin.robot.geometry import Geometry

pytestmark = pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")

Floats = np.ndarray


@pytest.fixture(scope="module")
def nominal() -> Geometry:
    return Geometry.nominal(gtpin.load_robot("gantry_tau"))


def variance_reduction(found: gtpin.Calibration, directions: Floats) -> Floats:
    """Variance reduction along directions in tolerances."""
    tolerance = found.model.geometry.tolerance
    covariance = found.covariance / np.outer(tolerance, tolerance)
    return 1.0 - np.einsum("im,ij,jm->m", directions, covariance, directions)


def poses(machine: Closures, rng: np.random.Generator, q: Floats) -> Seen:
    """Positions and orientations of the TCP by a tracker that stands somewhere."""
    turn, at = Rotation.from_rotvec(rng.normal(0.0, 0.7, 3)), rng.uniform(-3.0, 3.0, 3)
    T, R = machine.poses(q)
    seen = turn.apply(T) + at + rng.normal(0.0, 2e-5, T.shape)
    wxyz = (Rotation.from_rotvec(rng.normal(0.0, 5e-5, T.shape)) * turn * Rotation.from_matrix(R)).as_quat(
        scalar_first=True
    )
    said = {"name": "laser", "kind": "tracker", "position_sigma": 2e-5, "orientation_sigma": 5e-5, "frame": "free"}
    columns = dict(zip(("x", "y", "z"), seen.T, strict=True)) | dict(zip(("qw", "qx", "qy", "qz"), wxyz.T, strict=True))
    return Seen(said, q, columns)


@pytest.mark.slow
def test_what_is_said_to_tell_a_direction_tells_it_and_nothing_else_does(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(7)
    machine = draw(rng).gantry
    touches = bed(machine, rng, 150, heights=True)
    alone = gtpin.calibrate(read(tmp_path / "touches", touches))
    count = len(alone.unobservable)
    said = np.array([None if remedy is None else remedy.what for remedy in alone.remedies])
    directions = alone.observability.directions[:, :count]
    assert (variance_reduction(alone, directions) < 0.5).all()
    # At the poses that the sentences are about: twelve, evenly taken.
    q = touches.q[np.linspace(0, len(touches.q) - 1, 12).astype(int)]
    monkeypatch.setattr(virtual_instruments, "commands", lambda *_: q)
    others: dict[str, Seen] = {"tilts": level(machine, rng, 12), "poses": poses(machine, rng, q)}
    tried = 0
    for what, other in others.items():
        other = replace(other, prefix="o")
        both = gtpin.calibrate(read(tmp_path / "both", touches, other))
        told = said == what
        tried += int(told.sum())
        assert (variance_reduction(both, directions[:, told]) > 0.49).all()
        hopeless = said == None  # noqa: E711 (by element)
        assert hopeless.any()
        assert (variance_reduction(both, directions[:, hopeless]) < 0.51).all()
    assert tried >= 3


def test_growth_of_all_lengths_is_called_the_scale(nominal: Geometry) -> None:
    growth = np.array([p.nominal if p.unit == "m" else 0.0 for p in nominal.parameters]) / nominal.tolerance
    growth /= np.linalg.norm(growth)
    (scale,) = unseen_words(nominal, growth[:, None], np.array([0.1]), [None])
    assert "scale of the machine" in scale
    other = np.roll(growth, 7)
    (unlike,) = unseen_words(nominal, other[:, None], np.array([0.1]), [None])
    assert "scale" not in unlike


def test_sizes_are_one_standard_deviation_with_their_signs(nominal: Geometry) -> None:
    i, j = (nominal.names.index(name) for name in ("length[1]", "length[2b]"))
    direction = np.zeros(len(nominal.names))
    direction[i], direction[j] = -0.8, 0.6
    (words,) = unseen_words(nominal, direction[:, None], np.array([0.19]), [Remedy("tilts", 12)])
    sigma = 0.9  # the root of 1 - 0.19
    assert f"length[1] by {1e3 * 0.8 * sigma * nominal.tolerance[i]:+.2g} mm" in words
    assert f"length[2b] by {-1e3 * 0.6 * sigma * nominal.tolerance[j]:+.2g} mm" in words
    assert words.endswith("12 readings of a tilt sensor would determine it.")
