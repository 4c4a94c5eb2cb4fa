"""What the data can and can't see, and the freedoms that a fit takes."""

import numpy as np
import pytest
import virtual_gantry
from virtual_gantry import GANTRY, ORIENTATION_SIGMA, POSITION_SIGMA, commands, draw, indices, measured, tolerance

import gtpin
from gtpin.calibration.observability import UNSEEN

COUNT = 60


@pytest.fixture(scope="module", params=["poses", "positions", "free"])
def case(request):
    free, orientation = request.param == "free", request.param != "positions"
    _, dataset = virtual_gantry.case(np.random.default_rng(6), COUNT, free=free, orientation=orientation)
    return request.param, dataset.q, gtpin.calibrate(dataset)


def whitened(found, q, view=None):
    """Whitened scaled Jacobian by central differences of the tests' own closures about the identified geometry."""
    identified = dict(zip(found.names, found.model.geometry.deviation, strict=True))
    columns = []
    h = 1e-3
    for name in found.names:
        ways = (identified | {name: identified[name] + sign * h * tolerance(name)} for sign in (1.0, -1.0))
        (T1, R1), (T0, R0) = (GANTRY.off(way).poses(q) for way in ways)
        K = (R1 - R0) @ np.swapaxes((R1 + R0) / 2.0, 1, 2)
        turn = np.stack([K[:, 2, 1] - K[:, 1, 2], K[:, 0, 2] - K[:, 2, 0], K[:, 1, 0] - K[:, 0, 1]], axis=1) / 2.0
        columns.append(np.hstack([T1 - T0, turn]) / (2.0 * h))
    J = np.stack(columns, axis=2)
    J[:, :3] /= POSITION_SIGMA
    J[:, 3:] /= ORIENTATION_SIGMA
    return J[:, : found.residual.shape[1]]


def rigid(found, q):
    """Whitened motion of all poses with the frame they are measured in (only what it spans matters)."""
    T, _ = GANTRY.off(dict(zip(found.names, found.model.geometry.deviation, strict=True))).poses(q)
    motion = np.zeros((len(q), 6, 6))
    motion[:, :3, :3] = motion[:, 3:, 3:] = np.eye(3)
    for k in range(3):
        motion[:, :3, 3 + k] = np.cross(np.eye(3)[k], T)
    motion[:, :3] /= POSITION_SIGMA
    motion[:, 3:] /= ORIENTATION_SIGMA
    return motion.reshape(-1, 6)


def seen_by_the_data(kind, found, q):
    """Singular values and directions of what is left of the Jacobian once a free frame has taken its share."""
    J = whitened(found, q).reshape(-1, len(found.names))
    if kind == "free":
        Q, _ = np.linalg.qr(rigid(found, q))
        J = J - Q @ (Q.T @ J)
    return J, *np.linalg.svd(J, full_matrices=False)[1:]


@pytest.mark.slow
def test_indices_directions_and_sigmas_equal_an_independent_singular_value_decomposition(case):
    kind, q, found = case
    J, s, Vt = seen_by_the_data(kind, found, q)
    covariance = Vt.T @ np.diag(1.0 / (1.0 + s**2)) @ Vt
    np.testing.assert_allclose(found.sigma / found.model.geometry.tolerance, np.sqrt(np.diag(covariance)), rtol=2e-3)
    np.testing.assert_allclose(np.sort(found.observability.variance_reduction)[::-1], s**2 / (1.0 + s**2), atol=2e-4)
    # Each direction is an eigenvector: what the data see along it is what is told.
    along = np.linalg.norm(J @ found.observability.directions, axis=0) ** 2
    np.testing.assert_allclose(found.observability.variance_reduction, along / (1.0 + along), atol=2e-4)
    told = found.observability.indices
    well = s > 1e-3 * s[0]  # differences of 1e-6 relative tell the smaller ones roughly only
    assert told["O3"] > 0.0  # compared digit by digit in test_calibration_refusals.py, with exact derivatives
    assert told["O2"] == pytest.approx(told["O3"] / s[0], rel=1e-3)
    assert told["O4"] == pytest.approx(told["O3"] ** 2 / s[0], rel=1e-3, abs=1e-15)
    assert well.sum() >= 10


def test_o1_and_o5_follow_from_the_singular_values_where_all_are_seen():
    """With the joints held, what is left is well seen, and the indices can be compared digit by digit."""
    rng = np.random.default_rng(1)
    q = commands(rng, COUNT)
    drawn = [name for name in gtpin.Geometry.nominal(gtpin.load_robot("gantry_tau")).names if "joint" not in name]
    found = gtpin.calibrate(measured(draw(rng, drawn), q, rng), without=["platform_joint", "cart_joint"])
    assert sorted(found.names) == sorted(drawn)
    assert not found.unobservable
    J = whitened(found, q).reshape(-1, len(drawn))
    s = np.linalg.svd(J, compute_uv=False)
    assert found.observability.indices == pytest.approx(indices(s, 6 * COUNT), rel=1e-4)


@pytest.mark.slow
def test_a_direction_that_the_data_can_t_see_changes_no_prediction(case):
    kind, q, found = case
    assert found.unobservable
    geometry = found.model.geometry
    blind = np.flatnonzero(found.observability.variance_reduction < 0.01)
    assert blind.size
    for k in blind:
        # A free instrument moves along by millimetres, and the removal of its motion below is linear: a tenth does.
        step = 0.1 if kind == "free" else 1.0
        along = geometry.tolerance * found.observability.directions[:, k]
        moved = gtpin.Model(geometry.with_values(geometry.values + step * along))
        change = moved.predict(q).minus(gtpin.Model(geometry).predict(q))  # in the base frame
        if kind == "free":
            Q, _ = np.linalg.qr(rigid(found, q))
            flat = (change / np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)).ravel()
            residual = (flat - Q @ (Q.T @ flat)).reshape(-1, 6)
        else:
            residual = change / np.repeat([POSITION_SIGMA, ORIENTATION_SIGMA], 3)
        residual = residual[:, : found.residual.shape[1]]
        # One tolerance along it moves all 60 poses together by less than a tenth of the noise's sigma, root of the sum of
        # squares; the bend of the closures over a tolerance (1e-3^2 / 2 of 0.2 m) adds a few tenths a pose.
        assert np.sqrt((residual**2).mean()) < 0.2 * step


def test_directions_are_named_with_weights_in_tolerances(case):
    _, _, found = case
    directions = found.observability.directions
    np.testing.assert_allclose(directions.T @ directions, np.eye(len(found.names)), atol=1e-9)
    told = found.unobservable
    assert len(told) == (found.observability.variance_reduction < UNSEEN).sum()
    assert [d.variance_reduction for d in told] == sorted(d.variance_reduction for d in told)
    for k, direction in enumerate(told):
        assert set(direction.weights) <= set(found.names)
        weights = list(direction.weights.values())
        assert [abs(w) for w in weights] == sorted((abs(w) for w in weights), reverse=True)
        assert weights[0] > 0.0
        vector = np.zeros(len(found.names))
        for name, weight in direction.weights.items():
            vector[found.names.index(name)] = weight
        # Small weights are left out, so nearly a unit vector and nearly the direction itself.
        assert 0.5 < np.linalg.norm(vector) <= 1.0 + 1e-9
        assert abs(vector @ directions[:, k]) == pytest.approx(vector @ vector)


def test_freedoms_are_measured_components_less_what_was_learned(case):
    kind, _, found = case
    components = COUNT * found.residual.shape[1]
    frame = 6 if kind == "free" else 0  # learned from the data altogether
    assert found.dof + found.observability.variance_reduction.sum() + frame == pytest.approx(components, abs=1e-4)
    for variance_reduction in (found.variance_reduction, found.observability.variance_reduction):
        assert (variance_reduction >= -1e-9).all()
        assert (variance_reduction <= 1.0).all()
