"""Encoders in 3-D: drawn at the joint that they read, which moves with the loop."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin.data.instrument_tables import EncoderTable
from gtpin.model.model import FittedInstrument
from gtpin.report.instrument_places import InstrumentPlaces
from gtpin.report.skeleton import skeleton
from gtpin.view.still import still

FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"
BASE, ROTATED, CRANK = np.array([-0.1, 0.0, 0.0]), 2.2, 0.3
"""Of the left drive, as in the URDF: its place, m, the angle of its crank from the x axis, rad, and the crank's length, m."""


def with_encoder() -> gtpin.Model:
    encoder = FittedInstrument(EncoderTable(name="elbow", kind="encoder", joint="elbow_left"))
    return gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(FIVE_BAR)), instruments=(encoder,))


def left_elbow(q: float) -> np.ndarray:
    """(3,) where the left crank ends, by trigonometry, base frame, m."""
    angle = ROTATED + q
    return BASE + CRANK * np.array([np.cos(angle), 0.0, np.sin(angle)])


def test_an_encoder_has_the_place_of_its_joint() -> None:
    places = InstrumentPlaces.of(with_encoder().instruments)
    assert places
    assert places.encoders == {"elbow": "elbow_left"}
    assert not places.targets


def test_the_page_shows_an_encoder_at_its_joint_and_moves_it_with_the_loop() -> None:
    pytest.importorskip("viser", reason="viser is not installed")
    from gtpin.view.scene import Scene

    scene = Scene(with_encoder(), None, port=0)
    try:
        assert scene.instruments is not None
        ball, (label,) = scene.instruments.drawn["/instruments/encoders/elbow"], scene.instruments.labels
        assert label.text == "elbow"
        for q in ([0.0, 0.0], [0.2, -0.1]):
            scene.show(np.array(q))
            np.testing.assert_allclose(ball.position, left_elbow(q[0]), atol=1e-9)
            np.testing.assert_allclose(label.position, left_elbow(q[0]), atol=1e-9)
    finally:
        scene.stop()


def test_a_still_image_marks_and_names_an_encoder_at_its_joint() -> None:
    (axes,) = still(with_encoder()).axes
    (mark,) = [line for line in axes.lines if line.get_marker() == "D"]
    np.testing.assert_allclose(np.ravel(mark.get_data_3d()), left_elbow(0.0), atol=1e-9)
    assert "elbow" in [text.get_text().strip() for text in axes.texts]


def test_an_encoder_at_a_rod_is_where_the_rod_hangs_on_the_platform() -> None:
    robot = gtpin.load_robot("gantry_tau")
    encoder = FittedInstrument(EncoderTable(name="wrist", kind="encoder", joint="link2b_pitch"))
    model = gtpin.Model(gtpin.Geometry.nominal(robot), instruments=(encoder,))
    machine = skeleton(model)
    assert machine is not None
    (axes,) = still(model).axes
    (mark,) = [line for line in axes.lines if line.get_marker() == "D"]
    seat = machine.platform[robot.rod_sites.index("link2b")]
    np.testing.assert_allclose(np.ravel(mark.get_data_3d()), seat, atol=1e-9)
