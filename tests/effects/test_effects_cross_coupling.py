"""Products of cosines by which the joints of robots depend on each other."""

import numpy as np
import pytest
from effect_places import nominal_at

import gtpin
from gtpin.effects.cross_coupling import NEAREST, PAIR, SEVERAL_JOINTS, SINGLE, CrossCoupling, _products, _with_count

ROBOT = gtpin.load_robot("ur5")


@pytest.mark.parametrize("rods", [True, False])
def test_the_number_of_coefficients_tells_the_products(rods: bool) -> None:
    for others in range(1, 30):
        chosen = _products(others, rods)
        found = _with_count(chosen.count)
        assert (found.others, found.rows) == (others, chosen.rows)


def test_no_product_is_there_twice_and_single_cosines_come_first_joint_by_joint() -> None:
    for others in range(1, 8):
        for chosen in (_products(others, True), _products(others, False)):
            assert len(set(chosen.rows)) == len(chosen.rows)
            first = chosen.rows[: others * chosen.single]
            assert first == tuple(
                tuple(order if k == joint else 0 for k in range(others))
                for joint in range(others)
                for order in range(1, chosen.single + 1)
            )


@pytest.mark.parametrize("others", range(SEVERAL_JOINTS, 12))
def test_joints_of_an_arm_couple_one_by_one_and_two_by_two(others: int) -> None:
    rows = _products(others, False).rows
    alone = [row for row in rows if sum(o > 0 for o in row) == 1]
    pairs = [row for row in rows if sum(o > 0 for o in row) == 2]
    assert len(alone) + len(pairs) == len(rows)
    assert max(map(sum, alone)) == SINGLE
    assert max(map(sum, pairs)) == PAIR


@pytest.mark.parametrize("own", range(9))
def test_only_the_nearest_joints_couple_two_by_two_at_every_joint(own: int) -> None:
    chosen = _products(8, False, own)
    joints = [k for k in range(9) if k != own]  # of nine
    coupled = {joints[k] for row in chosen.rows if sum(o > 0 for o in row) == 2 for k, o in enumerate(row) if o}
    assert len(coupled) == NEAREST
    farthest = max(abs(k - own) for k in coupled)
    assert all(abs(k - own) >= farthest for k in joints if k not in coupled)
    assert chosen.count == _products(8, False).count


@pytest.mark.parametrize("site", [0, 3, 6])
def test_a_far_joint_couples_less_than_a_near_one(site: int) -> None:
    robot = gtpin.load_robot("panda")
    q = np.random.default_rng(1).uniform(-0.3, 0.3, (20, robot.n_actuators)) + gtpin.home(robot).q
    sigma = CrossCoupling().basis(nominal_at(robot, q), robot.sites[site]).sigma
    single = sigma[: SINGLE * (robot.n_actuators - 1)].reshape(-1, SINGLE)[:, 0]
    distance = np.abs(np.delete(np.arange(robot.n_actuators), site) - site)
    assert single * distance == pytest.approx(np.full(len(single), single[distance == 1][0]))


def test_an_arm_s_coupling_is_fitted_where_it_depends_finely_on_two_neighbours() -> None:
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (250, ROBOT.n_actuators))
    basis = CrossCoupling().basis(nominal_at(ROBOT, q), ROBOT.sites[2])
    columns = basis.command[1] * basis.sigma
    wanted = 1e-4 * np.sin(3.0 * q[:, 1]) * np.cos(1.5 * q[:, 3])
    fitted = columns @ np.linalg.lstsq(columns, wanted, rcond=None)[0]
    assert np.std(wanted - fitted) < 0.2 * np.std(wanted)
