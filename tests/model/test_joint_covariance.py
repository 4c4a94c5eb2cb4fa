"""The joint covariance of geometry and effects that a diagnosis gives its model."""

import numpy as np
import pytest

import gtpin
from gtpin.bench.simulator import make_case

pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")]


@pytest.fixture(scope="module")
def diagnosed():
    case = make_case(11, effects=[("backlash", "cart1"), ("encoder_scale", "cart3")], noncentrality=3000.0, poses=120)
    return case, gtpin.diagnose(case.dataset)


def test_blocks_of_the_joint_covariance_are_those_of_geometry_and_effects(diagnosed):
    _, found = diagnosed
    model, p = found.model, len(found.model.geometry.parameters)
    joint = model.joint_covariance
    assert len(model.effects) >= 2
    np.testing.assert_allclose(joint[:p, :p], model.covariance, rtol=1e-12)
    for active in model.effects:
        own = slice(p, p + len(active.coefficients))
        np.testing.assert_allclose(joint[own, own], active.covariance, rtol=1e-12)
        p = own.stop
    assert p == len(joint)
    assert np.linalg.eigvalsh(joint / np.sqrt(np.outer(joint.diagonal(), joint.diagonal()))).min() > -1e-9


def test_predictions_are_as_sure_as_the_joint_covariance_says_and_surer_than_its_blocks_alone(diagnosed):
    """An effect and the geometry that absorbs it are known together better than each by itself."""
    from gtpin.diagnosis.earlier import Earlier

    case, found = diagnosed
    earlier, q = Earlier(found.model), case.dataset.q[:20]
    known = {name: values[:20] for name, values in case.dataset.covariates.items()}
    J = earlier.jacobian(q, known, found.model.kinematics.forward(q))[:, :3].reshape(60, -1)
    blocks = np.zeros_like(earlier.covariance)
    p = len(found.model.geometry.parameters)
    blocks[:p, :p], blocks[p:, p:] = earlier.covariance[:p, :p], np.diag(earlier.covariance.diagonal()[p:])
    together, alone = (np.sqrt(np.einsum("ij,jk,ik->i", J, C, J).mean()) for C in (earlier.covariance, blocks))
    assert together < 1e-5  # 120 poses of 15 um
    assert together < alone
