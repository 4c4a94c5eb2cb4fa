"""A machine of the plant built again in MuJoCo: links and carts on springs, under gravity, payload and pushes, at rest.

Nothing of the plant's mechanics is used: no closures, no statics. Bodies, springs and weights are told to MuJoCo, and time
does the rest. The plant gives the numbers of the machine, and its rigid poses to start from.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.kinematics.poses import Poses

Array = np.ndarray

TIMESTEP, FREQUENCY, DAMPING = 5e-4, 1000.0, 5.0
"""s; rad/s to which reflected inertia brings the springs down; damping over stiffness, in 1 / FREQUENCY."""
QUIET, PATIENCE = 1e-7, 6000
"""m/s or rad/s of every coordinate at rest; steps."""


@dataclass(frozen=True)
class Springs:
    """What gives way, and by how much: 0 or missing where it is rigid.

    Parameters
    ----------
    links
        (k,) m/N.
    carts
        By number: (6,) m/N along the track and the two axes across it, rad/(N m) about them; a cart turns about the mean of
        its joints.
    """

    links: Sequence[float]
    carts: Mapping[int, Sequence[float]] = field(default_factory=dict)


class SpringMachine:
    """The machine in MuJoCo."""

    def __init__(self, machine: RodMachine, springs: Springs) -> None:
        self.machine = machine
        self.model = mujoco.MjModel.from_xml_string(_xml(machine, springs))
        self.data = mujoco.MjData(self.model)
        self.frames = _rod_frames(machine)
        self.floats = self.model.joint("floats").qposadr[0]
        self.rods = [self.model.joint(f"pitch{i}").qposadr[0] for i in range(len(machine.rod_masses))]
        self.load = self.model.body("payload").id

    def at_rest(self, q: Array, start: Poses, payload: Array, force: Array) -> Poses:
        """(N) poses of the TCP, base frame, at commands q (N, n), with a payload (N,), kg, and a push (N, 3), N, at the TCP."""
        rows = [self._one(*row) for row in zip(q, start.T, start.R, payload, force, strict=True)]
        return Poses(np.array([T for T, _ in rows]), np.array([R for _, R in rows]))

    def _one(self, q: Array, T: Array, R: Array, payload: float, force: Array) -> tuple[Array, Array]:
        machine, model, data = self.machine, self.model, self.data
        mujoco.mj_resetData(model, data)
        model.body_mass[self.load] = 1e-9 + payload
        centre = np.array([_centre(machine, c) for c in range(machine.n_carts)])
        data.mocap_pos[:] = centre + q[:, None] * machine.tracks
        pose = np.concatenate([T, Rotation.from_matrix(R).as_quat(scalar_first=True)])
        data.qpos[self.floats : self.floats + 7] = pose
        seats = machine.C0 + q[machine.driver, None] * machine.tracks[machine.driver]
        for i, seat in enumerate(seats):
            x, y, z = self.frames[i].inv().apply(_towards(R.T @ (seat - T) - machine.P[i]))
            data.qpos[self.rods[i] : self.rods[i] + 2] = np.arctan2(-y, z), np.arcsin(x)
        data.xfrc_applied[self.load, :3] = force
        for _ in range(PATIENCE):
            mujoco.mj_step(model, data)
            if np.abs(data.qvel).max() < QUIET:
                break
        else:
            raise AssertionError(f"not at rest at {q}")
        mujoco.mj_kinematics(model, data)
        platform = model.body("platform").id
        return data.xpos[platform].copy(), data.xmat[platform].reshape(3, 3).copy()


def _xml(machine: RodMachine, springs: Springs) -> str:
    """The platform's frame is the TCP's; rods point along their z axes, half of each on either side of its spring;
    spin about their axes, which moves nothing, is left out."""
    gravity, frames = machine.robot.model.gravity.linear, _rod_frames(machine)
    out = [
        f'<mujoco><compiler angle="radian"/><option timestep="{TIMESTEP}" integrator="implicitfast" tolerance="1e-14"',
        f' gravity="{_text(gravity)}"/>',
        '<default><equality solref="0.001 1" solimp="0.9999 0.9999 0.001"/></default><worldbody>',
    ]
    for c in range(machine.n_carts):
        axes = np.vstack([machine.tracks[c], machine.across[c]])
        joints = [
            _spring(f"cart{c}_{j}", "slide" if j < 3 else "hinge", axes[j % 3], compliance)
            for j, compliance in enumerate(springs.carts.get(c, ()))
            if compliance > 0.0
        ]
        seats = [
            f'<site name="seat{i}" pos="{_text(machine.levers[i])}"/>' for i in np.flatnonzero(machine.driver == c)
        ]
        # The cart's own weight, which is always there, is held up; what hangs on it is what bends it.
        mass = '<inertial pos="0 0 0" mass="40" diaginertia="1 1 1"/>'
        out.append(f'<body name="cart{c}" mocap="true" pos="{_text(_centre(machine, c))}">')
        out.append(f'<body name="held{c}" gravcomp="1">{"".join(joints)}{mass}{"".join(seats)}</body></body>')
    out.append('<body name="platform"><freejoint name="floats"/>')
    # A plate of some extent: at rest its moments of inertia don't matter.
    out.append(f'<inertial pos="{_text(machine.plate_center)}" mass="{machine.plate_mass!r}" diaginertia="1 1 1"/>')
    out.append('<body name="payload"><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/></body>')
    for i, P in enumerate(machine.P):
        L, mass = float(machine.L0[i]), float(machine.rod_masses[i])
        half = f'mass="{mass / 2.0!r}" diaginertia="0.2 0.2 0.01"'
        stretch = _spring(f"stretch{i}", "slide", np.array([0.0, 0.0, 1.0]), springs.links[i])
        quat = frames[i].as_quat(scalar_first=True)
        out.append(f'<body name="rod{i}" pos="{_text(P)}" quat="{_text(quat)}">')
        out.append(f'<joint name="pitch{i}" axis="1 0 0"/><joint name="yaw{i}" axis="0 1 0"/>')
        out.append(f'<inertial pos="0 0 {L / 4.0!r}" {half}/><body name="end{i}" pos="0 0 {L / 2.0!r}">{stretch}')
        out.append(f'<inertial pos="0 0 {L / 4.0!r}" {half}/><site name="tip{i}" pos="0 0 {L / 2.0!r}"/></body></body>')
    out.append("</body></worldbody><equality>")
    out += [f'<connect site1="tip{i}" site2="seat{i}"/>' for i in range(len(machine.rod_masses))]
    return "".join([*out, "</equality></mujoco>"])


def _rod_frames(machine: RodMachine) -> list[Rotation]:
    """Rotations that turn z into the rods' directions at home, TCP frame."""
    home = machine.home
    seats = machine.ends(machine.robot.home_q[None]).C[0]
    own = (seats - home.T[0]) @ home.R[0] - machine.P
    return [Rotation.align_vectors([_towards(u)], [[0.0, 0.0, 1.0]])[0] for u in own]


def _towards(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)


def _centre(machine: RodMachine, cart: int) -> Array:
    """(3,) mean of a cart's joints with all commands zero, base frame, m."""
    return machine.C0[machine.driver == cart].mean(axis=0)


def _spring(name: str, kind: str, axis: Array, compliance: float) -> str:
    if compliance <= 0.0:
        return ""
    k = 1.0 / compliance
    own = f'stiffness="{k!r}" damping="{DAMPING * k / FREQUENCY!r}" armature="{k / FREQUENCY**2!r}"'
    return f'<joint name="{name}" type="{kind}" axis="{_text(axis)}" {own}/>'


def _text(values: Array) -> str:
    return " ".join(repr(float(x)) for x in values)
