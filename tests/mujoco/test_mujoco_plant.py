"""The plant's compliance against MuJoCo's: forces, springs, levers and closures are each other's check."""

import warnings
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pytest
from spring_machine import SpringMachine, Springs

import gtpin
from gtpin.bench.simulator.causes.kinds import PlantedCause
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.noncentrality import Response
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise
from gtpin.bench.simulator.rod_machine import RodMachine
from gtpin.bench.simulator.situation import RodSituation
from gtpin.bench.simulator.visits import VirtualVisits, plan
from gtpin.data import Dataset
from gtpin.diagnosis.diagnose import diagnose
from gtpin.errors import GtpinWarning

CONDITIONS = SimulatedConditions(push=150.0)


def linear(springs: Springs, rods_weigh: bool = False) -> PlantedCause:
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


RIGID = [0.0] * 6
SOFT = {
    "links": Springs([5e-8] * 6),
    "one link": Springs([0.0, 0.0, 0.0, 3e-7, 0.0, 0.0]),
    "a cart along": Springs(RIGID, {1: [1e-7, 0.0, 0.0, 0.0, 0.0, 0.0]}),
    "a cart across": Springs(RIGID, {2: [0.0, 1e-7, 5e-8, 0.0, 0.0, 0.0]}),
    "a cart tips": Springs(RIGID, {2: [0.0, 0.0, 0.0, 1e-6, 2e-6, 3e-6]}),
    "all": Springs([5e-8] * 6, {c: [1e-7, 5e-8, 5e-8, 5e-7, 5e-7, 5e-7] for c in (1, 2)}),
}
RESIDUE = 2e-7
"""m and rad by which MuJoCo's own loops, which are a little soft, are open."""


@pytest.fixture(scope="module")
def day() -> Day:
    return Day.draw(7, 10)


def size(difference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.linalg.norm(difference[:, :3], axis=1), np.linalg.norm(difference[:, 3:], axis=1)


def test_a_rigid_machine_is_where_its_geometry_says(day: Day) -> None:
    assert np.abs(day.by_mujoco(Springs(RIGID)).minus(day.rigid)).max() < RESIDUE


@pytest.mark.parametrize("name", SOFT)
def test_poses_at_rest_agree(day: Day, name: str) -> None:
    found, expected = day.by_mujoco(SOFT[name]), day.by_plant(SOFT[name], rods_weigh=True)
    for off, bent in zip(size(found.minus(expected)), size(expected.minus(day.rigid)), strict=True):
        assert off.max() < 0.03 * bent.max() + RESIDUE
    assert size(expected.minus(day.rigid))[0].max() > 2e-6


@pytest.mark.parametrize("name", ["links", "a cart across", "all"])
def test_what_loads_change_agrees_for_the_plant_as_it_is(day: Day, name: str) -> None:
    """Of the rods' weight on the carts, which the plant leaves out, nothing is left in the change."""
    springs = SOFT[name]
    found = day.by_mujoco(springs).minus(day.unloaded.by_mujoco(springs))
    expected = day.by_plant(springs).minus(day.unloaded.by_plant(springs))
    assert size(expected)[0].max() > 1e-5
    assert size(found - expected)[0].max() < 0.02 * size(expected)[0].max()


CASES = {
    "rigid": (Springs(RIGID), []),
    "a soft link": (Springs([0.0, 0.0, 2e-7, 0.0, 0.0, 0.0]), [("link_compliance", "link2b")]),
    "a cart along": (Springs(RIGID, {1: [2e-7, 0.0, 0.0, 0.0, 0.0, 0.0]}), [("cart_compliance", "cart2")]),
    "a cart across": (Springs(RIGID, {2: [0.0, 3e-7, 3e-7, 0.0, 0.0, 0.0]}), [("cart_compliance", "cart3")]),
    "a cart tips": (Springs(RIGID, {2: [0.0, 0.0, 0.0, 8e-6, 8e-6, 8e-6]}), [("cart_compliance", "cart3")]),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_what_gives_way_is_named_and_nothing_else(name: str) -> None:
    number, (springs, causes) = list(CASES).index(name), CASES[name]
    dataset = Day.draw(20 + number, 100).dataset(springs, number)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", GtpinWarning)
        diagnosis = diagnose(dataset)
    assert [(cause.effect, cause.site) for cause in diagnosis.causes] == causes
    assert diagnosis.verdict == ("explained" if causes else "none")
    if name == "a soft link":
        found = diagnosis.causes[0].parameters["compliance"]
        assert found.unit == "m/N"
        assert abs(found.value - 2e-7) < 3.0 * found.sigma < 1.2e-7
