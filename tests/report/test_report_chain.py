"""A diagnosis of an arm, shown, predicted, exported and compensated: everything that users do with robots without rods."""

from __future__ import annotations

import itertools
import re
from html import unescape
from pathlib import Path
from xml.etree.ElementTree import fromstring

import numpy as np
import pinocchio as pin
import pytest

import gtpin
from gtpin.accuracy.sensitivity import sensitivity
from gtpin.comparison.compare import compare
from gtpin.compensation.compensate import compensate
from gtpin.compensation.machine import correctable
from gtpin.diagnosis.result import Diagnosis
from gtpin.effects.catalogue import effects_by_id
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import GtpinWarning
from gtpin.export.export import export
from gtpin.extras.controllers.corrections import corrections
from gtpin.kinematics.kinematics import Kinematics
from gtpin.report.diagnosis import DiagnosisPresentation
from gtpin.report.effect_curves import curves
from gtpin.report.effect_motions import placements
from gtpin.report.residuals import Residuals
from gtpin.report.skeleton import skeleton

ARM_FILE = Path(__file__).parents[2] / "examples" / "effects" / "arm.urdf"
ARM = gtpin.load_robot(ARM_FILE)
COMPLIANCE, AMPLITUDE, PERIODS = 4e-5, 3e-4, 8
SITE, PERIODIC = "shoulder", "waist"
FIVE_BAR = Path(__file__).parents[2] / "examples" / "loops" / "five_bar.urdf"


def measured(folder: Path, *, compliance: float = 0.0, amplitude: float = 0.0, count: int = 90) -> Path:
    """A dataset of an arm by Pinocchio alone: its shoulder gives way, its waist departs periodically."""
    rng = np.random.default_rng(3)
    model, data = ARM.model, ARM.model.createData()
    q = np.array([0.0, 0.4, 1.1, 0.3, 0.5, 0.0]) + np.array([1.4, 0.7, 0.7, 1.0, 1.0, 1.5]) * rng.uniform(
        -1, 1, (count, 6)
    )
    payload = rng.choice([0.0, 2.0, 5.0], count)
    rows = ["pose," + ",".join(f"q{i}" for i in range(1, 7)) + ",x,y,z,qw,qx,qy,qz,payload"]
    for i in range(count):
        turned = q[i].copy()
        turned[0] += amplitude * np.cos(PERIODS * q[i, 0])
        pin.computeJointJacobians(model, data, turned)
        by_joints = pin.getFrameJacobian(model, data, ARM.tcp_joint, ARM.tcp_placement, pin.LOCAL_WORLD_ALIGNED)[:3]
        held = by_joints.T @ np.array([0.0, 0.0, 9.81 * payload[i]])
        turned[1] -= compliance * (pin.computeGeneralizedGravity(model, data, turned) + held)[1]
        pin.forwardKinematics(model, data, turned)
        there = data.oMi[ARM.tcp_joint] * ARM.tcp_placement
        T = there.translation + 1.5e-5 * rng.standard_normal(3)
        turn = pin.Quaternion(pin.exp3(4e-5 * rng.standard_normal(3)) @ there.rotation)
        values = [*q[i], *T, turn.w, turn.x, turn.y, turn.z, payload[i]]
        rows.append(f"p{i}," + ",".join(repr(float(v)) for v in values))
    folder.mkdir()
    (folder / "poses.csv").write_text("\n".join(rows) + "\n")
    (folder / "dataset.toml").write_text(
        f'schema = "gtpin-dataset/1"\nrobot = "{ARM_FILE}"\n'
        '[instrument]\nposition_sigma = 1.5e-5\norientation_sigma = 4e-5\nframe = "robot"\n'
    )
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return measured(tmp_path_factory.mktemp("arm") / "given", compliance=COMPLIANCE)


@pytest.fixture(scope="module")
def found(folder: Path) -> Diagnosis:
    return gtpin.diagnose(gtpin.Dataset.read(folder))


@pytest.fixture(scope="module")
def page(found: Diagnosis) -> str:
    return DiagnosisPresentation(found).page()


@pytest.mark.slow
def test_the_joint_is_named_and_where_has_no_rods(found: Diagnosis) -> None:
    assert [(c.effect, c.site) for c in found.causes] == [("joint_compliance", SITE)]
    value = found.causes[0].parameters["compliance"]
    assert abs(value.value - COMPLIANCE) < 4.0 * value.sigma
    assert value.unit == "rad/(N m)"
    where = found.to_json()["where"]
    assert where["rod"] == {}
    assert set(where["site"]) >= {*ARM.sites, "arm", "platform", "frame"}
    assert sum(where["site"].values()) == pytest.approx(1.0)


@pytest.mark.slow
def test_the_page_draws_the_arm_with_its_joints_and_rings_the_cause(page: str) -> None:
    drawing = re.search(r'<svg class="drawing".*?</svg>', page, re.DOTALL)
    assert drawing is not None
    shapes = fromstring(drawing[0])
    texts = " ".join(text.text or "" for text in shapes.iter("text"))
    assert all(site in texts for site in ARM.sites)
    assert sum("--accent" in circle.get("style", "") for circle in shapes.iter("circle")) == 1


@pytest.mark.slow
def test_the_page_speaks_of_no_carts_tracks_or_rods(page: str) -> None:
    body = re.sub(r"<(script|style|svg).*?</\1>", "", page[page.index("<body") :], flags=re.DOTALL)
    words = unescape(re.sub(r"<[^>]+>", " ", body))
    assert re.findall(r"\b(?:carts?|tracks?|rods?|guideways?)\b", words) == []
    assert f"The drive of {SITE} deflects under its load." in words


@pytest.mark.slow
def test_the_curve_is_the_joints_angle_over_the_moment_that_it_carries(found: Diagnosis) -> None:
    residuals = Residuals.of(found.dataset, found.baseline, found.model, found.set_aside_rows)
    (curve,) = curves(found.model.effects[0], residuals)
    assert (curve.name, curve.unit) == (f"angle of {SITE}", "rad")
    assert curve.x_title == f"moment on {SITE} about its axis (N m)"
    (line,) = curve.lines
    slope = np.polyfit(line.points_x.astype(float), line.points_y, 1)[0]
    assert slope == pytest.approx(COMPLIANCE, rel=0.02)
    poses = residuals.poses
    at = residuals.at(found.dataset.q, found.dataset.covariates)
    arms = np.linalg.norm(poses.T - at.bodies.frame(1)[1], axis=1)
    assert curve.lever is not None
    assert 0.3 * arms.mean() < curve.lever <= arms.max()


@pytest.mark.slow
def test_a_notebook_shows_it(found: Diagnosis) -> None:
    assert SITE in found._repr_html_()
    assert len(found.plot_effect(0).data) > 0
    assert len(found.plot_residuals("q2").data) > 0
    assert len(found.plot_workspace().data) > 0


def test_the_skeleton_goes_through_the_joints_to_the_tcp() -> None:
    machine = skeleton(gtpin.Model(gtpin.Geometry.nominal(ARM)), np.zeros(6))
    assert machine is not None
    np.testing.assert_allclose({spot.site: spot.at for spot in machine.spots}["elbow"], [0.0, 0.02, 0.52], atol=1e-12)
    np.testing.assert_allclose(machine.tcp, [0.0, 0.2, 1.0], atol=1e-12)
    ends = [line.ends for line in machine.of("link")]
    for one, other in itertools.pairwise(ends):
        np.testing.assert_array_equal(one[1], other[0])
    np.testing.assert_array_equal(ends[-1][1], machine.tcp)


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "told"), [("urdf", "does not hold"), ("sdf", "does not hold"), ("xml", "holds")])
def test_a_diagnosed_arm_is_exported_and_what_is_left_out_is_told(
    found: Diagnosis, ending: str, told: str, tmp_path: Path
) -> None:
    with pytest.warns(GtpinWarning, match=rf"{told} joint_compliance@{SITE}"):
        export(found.model, tmp_path / f"arm.{ending}")
    assert (tmp_path / f"arm.{ending}").stat().st_size > 1000


@pytest.mark.slow
def test_an_exported_urdf_has_the_calibrated_geometry(found: Diagnosis, tmp_path: Path) -> None:
    calibrated = found.baseline.model
    with pytest.warns(gtpin.GtpinWarning, match="leaves .* unexplained"):
        export(calibrated, tmp_path / "arm.urdf")
    again = gtpin.Model(gtpin.Geometry.nominal(gtpin.load_robot(tmp_path / "arm.urdf")))
    q = found.dataset.q[:5]
    one, other = again.kinematics.forward(q), calibrated.kinematics.forward(q)
    np.testing.assert_allclose(other.minus(one), 0.0, rtol=0, atol=1e-9)


@pytest.mark.slow
def test_corrected_commands_bring_the_arm_where_its_program_meant_it(found: Diagnosis) -> None:
    q, known = found.dataset.q[:6], {n: v[:6] for n, v in found.dataset.covariates.items()}
    meant = found.baseline.model.kinematics.forward(q)
    corrected = compensate(found.model, meant.T, known, rotations=meant.R, start=q)
    np.testing.assert_allclose(found.model.predict(corrected, known).minus(meant), 0.0, rtol=0, atol=1e-8)
    assert np.abs(corrected - q).max() < 0.02  # the posture is the program's own


@pytest.mark.slow
def test_a_periodic_deviation_of_a_joint_becomes_a_table_of_corrections(found: Diagnosis, tmp_path: Path) -> None:
    d = gtpin.diagnose(gtpin.Dataset.read(measured(tmp_path / "given", amplitude=AMPLITUDE, count=150)))
    assert [(c.effect, c.site) for c in d.causes] == [("rack_periodic", PERIODIC)]
    assert correctable(found.model) == ()  # a compliance is no table
    (table,) = corrections(d.model)
    assert (table.site, table.revolute) == (PERIODIC, True)
    inside = np.abs(table.nominal) < 1.2
    off = table.forward[inside] - table.nominal[inside]
    wanted = -AMPLITUDE * np.cos(PERIODS * table.nominal[inside])
    assert np.sqrt(np.mean((off - off.mean() - (wanted - wanted.mean())) ** 2)) < 0.1 * AMPLITUDE


def test_sensitivity_of_an_arm_is_that_of_its_levers() -> None:
    model = gtpin.Model(gtpin.Geometry.nominal(ARM))
    q = np.zeros((2, 6))
    with pytest.warns(gtpin.GtpinWarning, match="ZYZ angles jump"):
        found = sensitivity(model, q)
    table = found.to_table().set_index(["parameter", "link"])
    step = 5e-2  # mm
    assert table.loc[("x", "elbow"), "position_mm"] == pytest.approx(2 * 2 * step, rel=1e-9)
    # The shoulder's axis y turns the TCP, 0.9 m above it, by 2 sin(step / 2) times 0.9 m.
    assert table.loc[("ry", "shoulder"), "position_mm"] == pytest.approx(2 * 2 * step * 0.9, rel=1e-6)
    assert set(table.index.get_level_values("link")) == {*ARM.sites, "platform"}


def test_comparing_the_papers_models_is_refused_in_one_line(folder: Path) -> None:
    with pytest.raises(gtpin.GtpinError, match="models 1 to 5 are for carts on tracks"):
        compare(gtpin.Dataset.read(folder))


@pytest.mark.slow
def test_an_arm_has_a_still_image(found: Diagnosis, folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from gtpin.extras.view.gap import gap_of
    from gtpin.extras.view.still import still

    made = still(found.model, gap_of(found.model, gtpin.Dataset.read(folder)))
    texts = {text.get_text().strip() for text in made.axes[0].texts}
    assert texts >= set(ARM.sites)


@pytest.mark.parametrize("site", ["arm", "left", "right"])
def test_the_motions_of_a_link_s_tip_sum_to_the_effect(site: str) -> None:
    kinematics = Kinematics(gtpin.Geometry.nominal(gtpin.load_robot(str(FIVE_BAR))))
    q = np.random.default_rng(0).uniform(-0.4, 0.4, (5, 2))
    told = {"payload": np.linspace(0.0, 1.0, 5), "fy": np.linspace(-4.0, 5.0, 5)}
    at = OperatingPoints(kinematics, q, kinematics.forward(q), told)
    basis = effects_by_id()["link_compliance"].basis(at, site)
    summed = sum(motion.tcp[:, :, None] * motion.columns[:, None, :] for motion in placements(at, site, basis))
    np.testing.assert_allclose(summed, basis.displacement(at), atol=1e-12 * np.abs(basis.displacement(at)).max())
