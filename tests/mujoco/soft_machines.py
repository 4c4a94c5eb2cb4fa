"""Machines that give way: by the plant's mechanics and by MuJoCo's, and datasets of the latter."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from spring_machine import SpringMachine, Springs

import gtpin
from gtpin.bench.simulator.causes.cause import Cause
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.situation import RodSituation
from gtpin.bench.simulator.visits import VirtualVisits, plan
from gtpin.data import Dataset

CONDITIONS = SimulatedConditions(push=150.0)


def linear(springs: Springs, rods_weigh: bool = False) -> Cause:
    """The springs as a cause of the plant, whose own never are quite linear.

    ``rods_weigh``: the half of their rods' weight that the plant's carts are spared of, a constant force, bends them too.
    """

    def act(now: RodSituation) -> Deviation:
        deviation, machine = now.unbent(), now.machine
        deviation.length[:] = np.array(springs.links) * now.forces
        for cart, given in springs.carts.items():
            axes = np.vstack([machine.tracks[cart], machine.across[cart]])
            weight = machine.rod_masses[machine.driver == cart].sum() / 2.0 * machine.robot.model.gravity.linear
            force = now.pull(cart) + rods_weigh * weight
            deviation.shift[:, cart] = (force @ axes.T * given[:3]) @ axes
            deviation.turn[:, cart] = (now.moment(cart) @ axes.T * given[3:]) @ axes
        return deviation

    return act


@dataclass(frozen=True)
class Day:
    """A machine drawn from its tolerances, and a day's visits to its poses."""

    machine: RodMachine
    visits: VirtualVisits

    @staticmethod
    def draw(seed: int, poses: int) -> "Day":
        rng = np.random.default_rng(seed)
        machine = RodMachine.draw(gtpin.load_robot("gantry_tau"), rng)
        visits = plan(machine, poses, 1, CONDITIONS, rng)
        return Day(machine, visits.take(~visits.held))

    @cached_property
    def unloaded(self) -> "Day":
        """The same visits with nothing on the tool."""
        v = self.visits
        return Day(self.machine, replace(v, payload=np.zeros(len(v)), force=np.zeros((len(v), 3))))

    @cached_property
    def rigid(self) -> gtpin.Poses:
        return self.machine.predict(self.visits.q)

    def by_plant(self, springs: Springs, rods_weigh: bool = False) -> gtpin.Poses:
        plant = Response(self.machine, self.visits, np.zeros(3))
        return plant.seen([(linear(springs, rods_weigh), 1.0)])

    def by_mujoco(self, springs: Springs) -> gtpin.Poses:
        v = self.visits
        return SpringMachine(self.machine, springs).at_rest(v.q, self.rigid, v.payload, v.force)

    def dataset(self, springs: Springs, seed: int) -> Dataset:
        """What a laser tracker reads of the machine in MuJoCo."""
        noise = SimulatedNoise()
        seen = noise.measured(self.by_mujoco(springs), np.random.default_rng(seed))
        return Dataset(
            robot="gantry_tau",
            pose=np.array([str(number) for number in self.visits.pose], dtype=object),
            q=self.visits.q,
            position=seen.T,
            orientation=seen.quaternions,
            covariates=self.visits.columns(CONDITIONS),
            instrument=noise.instrument,
        )
