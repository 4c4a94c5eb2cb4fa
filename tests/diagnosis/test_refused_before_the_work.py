"""What can't be diagnosed is said before anything is fitted."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from urdfs import joint, loop, own, robot_of, urdf

import gtpin
from gtpin.bench.simulator import simulate
from gtpin.data import Dataset, InstrumentSection
from gtpin.errors import GtpinError


@pytest.fixture(scope="module")
def measured() -> Dataset:
    return simulate(gtpin.load_robot("ur5"), "ur5", poses=60, seed=0).dataset


FIXED = urdf("r", joint("j", "base", "end", kind="fixed"))
APART = urdf(
    "r",
    joint("left_joint", "base", "left"),
    joint("left_far_joint", "left", "left_far", "0.1 0 0"),
    joint("right_joint", "base", "right", "5.0 0 0"),
    loop("left_far", "0.1 0 0", "right", "0.1 0 0"),
    own(["left_joint"], "left_far"),
)


def of_robot(text: str, dataset: Dataset, folder: Path) -> Dataset:
    (folder / "robot.urdf").write_text(text)
    return replace(dataset, robot=str(folder / "robot.urdf"), q=dataset.q[:, :1], covariates={})


def free(dataset: Dataset) -> Dataset:
    return replace(dataset, instrument=dataset.instrument.model_copy(update={"frame": "free", "target": "free"}))


EXCLUDED = {"joint_compliance@cart1": "sites of joint_compliance are .*shoulder_lift_joint"}
EXCLUDED |= dict.fromkeys(["gremlins", "backlash@", "@shoulder_lift_joint", ""], "no effect is called")


@pytest.mark.filterwarnings("ignore:the links of:gtpin.errors.GtpinWarning")
@pytest.mark.parametrize(
    ("change", "options", "words"),
    [
        # 42 numbers, 42 parameters
        pytest.param(lambda d, _: d.take(np.arange(7)), {}, "measure at least 8 poses", id="too few for the geometry"),
        pytest.param(
            lambda d, _: free(d.take(np.arange(8))),
            {},
            "measure at least 9 poses",
            id="too few for frame and target",
            marks=pytest.mark.slow,
        ),
        pytest.param(lambda d, _: replace(d, q=np.tile(d.q[:1], (len(d), 1))), {}, "the same commands", id="still"),
        pytest.param(lambda d, folder: of_robot(FIXED, d, folder), {}, "nothing moves", id="does not move"),
        pytest.param(
            lambda d, folder: of_robot(APART, d, folder), {}, "loop", id="loops apart", marks=pytest.mark.slow
        ),
        *(
            pytest.param(lambda d, _: d, {"exclude": [word]}, words, id=f"excluded {word}")
            for word, words in EXCLUDED.items()
        ),
    ],
)
def test_what_can_not_be_diagnosed_is_refused_before_a_fit(
    change: Callable[[Dataset, Path], Dataset], options: dict[str, Any], words: str, measured: Dataset, tmp_path: Path
) -> None:
    steps: list[str] = []
    with pytest.raises(GtpinError, match=words) as error:
        gtpin.diagnose(change(measured, tmp_path), **options, progress=lambda step, number, value: steps.append(step))
    assert steps == []
    assert "\n" not in str(error.value)


OF_LOAD = {"joint_compliance", "bearing_compliance", "joint_clearance", "link_compliance"}


def test_a_robot_without_masses_is_told_and_its_effects_of_load_are_not_tested() -> None:
    rng = np.random.default_rng(2)
    turn = joint("turn", "base", "arm", "0.1 0.2 0.3", rpy="1.3 0.2 0.1", limit=3.0)
    tool = joint("tool", "arm", "tool0", "0.4 0 0.1", kind="fixed", rpy="0.5 0.1 -0.4")
    robot = robot_of("turner", turn, tool)
    q = rng.uniform(-2.5, 2.5, (40, 1))
    plain = gtpin.Model(gtpin.Geometry.nominal(robot)).predict(q)
    noise = [pin.exp6(np.repeat([1.5e-5, 5e-5], 3) * rng.standard_normal(6)) for _ in q]
    seen = [pin.SE3(R, T) * off for T, R, off in zip(plain.T, plain.R, noise, strict=True)]
    dataset = Dataset(
        robot="turner",
        pose=np.arange(40),
        q=q,
        position=np.array([M.translation for M in seen]),
        orientation=np.array([np.roll(pin.Quaternion(M.rotation).coeffs(), 1) for M in seen]),
        instrument=InstrumentSection(position_sigma=1.5e-5, orientation_sigma=5e-5),
    )
    with pytest.warns(gtpin.GtpinWarning, match="links of turner have no masses: effects of load"):
        found = gtpin.diagnose(dataset, robot)
    reasons = {c.effect: c.reason for c in found.candidates if c.effect in OF_LOAD}
    assert set(reasons) == OF_LOAD
    assert all(reason is not None and reason.kind == "no_masses" for reason in reasons.values())
    assert any(c.reason is None for c in found.candidates)


def computed(seed: int, digits: int) -> gtpin.Dataset:
    """Poses of an arm whose geometry is not nominal, as a controller writes its targets: without noise, and rounded."""
    rng = np.random.default_rng(seed)
    model = gtpin.read_model("ur5")
    geometry = model.geometry
    other = geometry.with_values(geometry.values + geometry.tolerance * rng.normal(size=len(geometry.values)))
    q = rng.uniform(-1.0, 1.0, (300, 6)) + np.array([0.0, -1.0, 1.5, 0.0, 1.0, 0.0])
    T = replace(model, geometry=other).predict(q).T
    pose = np.arange(len(q)).astype(str).astype(object)
    return gtpin.Dataset(
        robot="ur5", pose=pose, q=q, position=np.round(T, digits), instrument=InstrumentSection(frame="free")
    )


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "digits"), [(1, 9), (2, 8), (3, 12)])
def test_computed_positions_are_doubted_and_have_no_cause(seed, digits):
    with pytest.warns(gtpin.GtpinWarning, match="were they computed"):
        found = gtpin.diagnose(computed(seed, digits))
    assert found.verdict == "none"
    assert not found.causes
