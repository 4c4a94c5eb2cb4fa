"""Inverse dynamics of closed chains against Lagrange's equations, the balance of power, statics, and MuJoCo."""

import numpy as np
import pinocchio as pin
import pytest
from moving_robots import FIRST, MAKERS, POINTS, SECOND, made, motion

from gtpin.errors import ModelError
from gtpin.kinematics.frames import Moving
from gtpin.kinematics.posture import static_forces
from gtpin.kinematics.robot import Robot

Floats = np.ndarray
FORCE, MOMENT, PAYLOAD = np.array([12.0, -8.0, 5.0]), np.array([0.4, 0.7, -0.5]), 1.5
REDUNDANT = "two_pins"


@pytest.fixture(params=MAKERS)
def moved(request: pytest.FixtureRequest) -> Robot:
    return made(request.param)


def potential(robot: Robot, q: Floats) -> Floats:
    """(N,) energy of all masses in the field of gravity, J."""
    model, data = robot.model, robot.model.createData()
    return np.array([pin.computePotentialEnergy(model, data, row.configuration) for row in map(robot.forward, q)])


@pytest.mark.slow
def test_the_actuators_forces_are_lagranges(moved: Robot) -> None:
    """d/dt dT/dv - dT/dq + dU/dq, by differences over the commands; T by Pinocchio's mass matrix, without its dynamics."""
    (q, v, a), step, n = motion(moved), 2e-3, moved.n_actuators

    def slopes(values: Floats) -> Floats:
        return np.einsum("k,ik...->i...", FIRST / step, values.reshape(n, len(POINTS), *values.shape[1:]))

    around = np.concatenate([q + step * np.outer(POINTS, e) for e in np.eye(n)])
    dM, dU, M = slopes(moved.reflected_inertia(around)), slopes(potential(moved, around)), moved.reflected_inertia(q)
    expected = M @ a + np.einsum("kij,k,j->i", dM, v, v) - 0.5 * np.einsum("kij,i,j->k", dM, v, v) + dU
    found = moved.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(found).max())
    by_motion = found - moved.inverse_dynamics(q, 0.0 * v, a)
    assert np.abs(by_motion).max() > 1e-4 * np.abs(found).max()  # velocities do matter here


@pytest.mark.slow
def test_the_power_of_actuators_and_tool_is_the_change_of_energy(moved: Robot) -> None:
    (q, v, a), step = motion(moved, 2), 2e-3
    t = step * POINTS
    curve, rates = q + np.outer(t, v) + 0.5 * np.outer(t * t, a), v + np.outer(t, a)
    at = moved.forward(curve)
    energy = potential(moved, curve) - PAYLOAD * at.T @ np.asarray(moved.model.gravity.linear)
    energy += 0.5 * np.einsum("ni,nij,nj->n", rates, moved.reflected_inertia(curve), rates)
    energy += 0.5 * PAYLOAD * (moved.velocity(curve, rates)[:, :3] ** 2).sum(axis=1)
    forces = moved.inverse_dynamics(q, v, a, FORCE, PAYLOAD, MOMENT)
    power = forces @ v + np.concatenate([FORCE, MOMENT]) @ moved.velocity(q, v)
    assert power == pytest.approx(FIRST / step @ energy, abs=1e-8 * np.abs(energy).max() / step)


def test_at_rest_the_forces_are_the_static_ones(moved: Robot) -> None:
    q, rest = motion(moved, 3)[0], np.zeros(moved.n_actuators)
    if moved is made(REDUNDANT):
        with pytest.raises(ModelError, match="redundant"):
            moved.forces(q, rest, rest)
        return
    known = static_forces(moved.forward(q), FORCE, MOMENT, PAYLOAD)
    found = moved.forces(q, rest, rest, FORCE, PAYLOAD, MOMENT)
    for one, other in ((found.actuators, known.actuators), (found.loops, known.loops), (found.rods, known.rods)):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12 * np.abs(known.actuators).max())
    alone = moved.inverse_dynamics(q, rest, rest, FORCE, PAYLOAD, MOMENT)
    np.testing.assert_allclose(alone, known.actuators, rtol=0, atol=1e-11 * (1.0 + np.abs(known.actuators).max()))


def test_redundant_loops_take_nothing_from_the_actuators() -> None:
    one, two = made("parallelogram"), made(REDUNDANT)
    q, v, a = motion(one, 4)
    np.testing.assert_allclose(two.inverse_dynamics(q, v, a), one.inverse_dynamics(q, v, a), rtol=0, atol=1e-9)


def test_constraint_forces_balance_all_joints(moved: Robot) -> None:
    """Pinocchio's rnea less the loops' forces, through the Jacobian that Pinocchio gives, are the actuators' forces alone."""
    if moved is made(REDUNDANT):
        return
    q, v, a = motion(moved, 5)
    posture, forces = moved.forward(q), moved.forces(q, v, a)
    moving = Moving(moved, posture.configuration[None])
    V, A = moving.velocities(v[None])[0], moving.accelerations(v[None], a[None])[0]
    tau = moved.folded(pin.rnea(moved.model, moved.model.createData(), posture.configuration, V, A))
    for loop, (constraint, its) in enumerate(zip(moved.constraints, posture.constraint_data, strict=True)):
        gap = its.extract()
        J = np.reshape(pin.getConstraintJacobian(moved.model, posture.data, constraint, gap), (3, -1))
        tau += moved.folded(J).T @ (gap.oMc1.rotation.T @ forces.loops[loop])
    expected = np.zeros(moved.model.nv)
    expected[moved.driven] = forces.actuators
    for follower in moved.followers:
        tau[follower.index_v] = 0.0
    np.testing.assert_allclose(tau, expected, rtol=0, atol=1e-9 * (1.0 + np.abs(tau).max()))


def test_one_command_gives_the_row_of_many(moved: Robot) -> None:
    q, v, a = (np.array(part) for part in zip(*(motion(moved, seed) for seed in (6, 7)), strict=True))
    force, payload = np.array([FORCE, -FORCE]), np.array([0.0, PAYLOAD])
    many, M = moved.inverse_dynamics(q, v, a, force, payload), moved.reflected_inertia(q)
    for i in range(2):
        one = moved.inverse_dynamics(q[i], v[i], a[i], force[i], payload[i])
        np.testing.assert_allclose(one, many[i], rtol=0, atol=1e-10 * (1.0 + np.abs(one).max()))
        np.testing.assert_allclose(moved.reflected_inertia(q[i]), M[i], rtol=0, atol=1e-11 * np.abs(M).max())
    if moved is not made(REDUNDANT):
        both = moved.forces(q, v, a, force, payload)
        np.testing.assert_allclose(both.actuators, many, rtol=0, atol=1e-9 * (1.0 + np.abs(many).max()))
        assert both.loops.shape == (2, len(moved.constraints), 3)
        assert both.rods.shape == (2, len(moved.rods))
    np.testing.assert_allclose(M, np.swapaxes(M, 1, 2), rtol=0, atol=1e-12 * np.abs(M).max())
    assert (np.linalg.eigvalsh(M) > 0.0).all()


def test_a_uniform_rod_that_swings_is_pulled_at_its_middle_by_its_outer_half() -> None:
    """Cut at its middle: the outer half is moved by the loop's force, its weight and the axial force at the cut."""
    robot = made("gantry_tau")
    (q, v, a), h = motion(robot, 8), 1e-3
    forces = robot.forces(q, v, a)
    t = h * POINTS
    curve = q + np.outer(t, v) + 0.5 * np.outer(t * t, a)
    for i, rod in enumerate(robot.rods):
        ends = []
        for row in curve:
            data, (tip, placed) = robot.forward(row).data, robot.anchors[rod.tip]
            ends.append((data.oMi[rod.joint_id].translation.copy(), (data.oMi[tip] * placed).translation))
        ends = np.array(ends)
        along = ends[4, 1] - ends[4, 0]
        u, centre = along / np.linalg.norm(along), 0.25 * ends[:, 0] + 0.75 * ends[:, 1]
        outer = 4.1 / 2.0 * (SECOND @ centre / h**2 - np.asarray(robot.model.gravity.linear))
        on_rod = forces.loops[i] if rod.rod_end == 0 else -forces.loops[i]
        assert forces.rods[i] == pytest.approx((on_rod - outer) @ u, abs=1e-4)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.* left out:gtpin.errors.GtpinWarning")  # shapes
@pytest.mark.parametrize(("name", "size"), [("ur5", 0.5), ("five_bar", 0.4), ("gantry_tau", 0.2), ("stewart", 0.05)])
def test_driven_by_these_forces_alone_mujocos_machine_moves_as_told(name: str, size: float) -> None:
    """In MuJoCo, which closes loops by stiff springs: 3,000 steps without feedback end within 1e-6 m or rad of the commands.

    The same forces without what velocities take end more than 1,000 times farther off.
    """
    mujoco = pytest.importorskip("mujoco")
    from gtpin.extras.simulators.mechanism import mechanism
    from gtpin.extras.simulators.mjcf import to_mjcf

    robot, step, steps = made(name), 1e-4, 3000
    machine = mechanism(robot)
    model = mujoco.MjModel.from_xml_string(to_mjcf(machine, machine))
    model.dof_armature[:] = model.dof_damping[:] = 0.0
    model.opt.timestep, model.opt.integrator = step, mujoco.mjtIntegrator.mjINT_RK4
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION | mujoco.mjtDisableBit.mjDSBL_LIMIT
    model.eq_solref[:], model.eq_solimp[:, :2] = [2.0 * step, 1.0], 0.9999
    joints = [model.joint(actuator.joint) for actuator in robot.actuators]
    at, moved = [j.qposadr[0] for j in joints], [j.dofadr[0] for j in joints]
    rng, s, T = np.random.default_rng(3), np.linspace(0.0, 1.0, steps + 1)[:, None], steps * step
    travel = size * rng.choice([-1.0, 1.0], len(at)) * rng.uniform(0.5, 1.0, len(at))
    q = robot.home_q + travel * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    v, a = travel * 30.0 * (s * (1.0 - s)) ** 2 / T, travel * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / T**2
    off = []
    for rates in (v, 0.0 * v):
        data, forces = mujoco.MjData(model), robot.inverse_dynamics(q, rates, a)
        for k in range(steps):
            data.qfrc_applied[moved] = (forces[k] + forces[k + 1]) / 2.0
            mujoco.mj_step(model, data)
        off.append(np.abs(data.qpos[at] - q[-1]).max())
    assert off[0] < 1e-6
    assert off[1] > 1000.0 * off[0]
