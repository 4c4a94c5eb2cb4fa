"""Rods that change their length: a bracket pushes one, or its ball is out of round. Of the tests' own closures."""

from dataclasses import dataclass

import numpy as np
import pytest
from closures import ORIENTATION_SIGMA, POSITION_SIGMA, Closures, Floats, nominal
from diagnosed import quietly
from scipy.spatial.transform import Rotation

import gtpin
from gtpin.data import InstrumentSection
from gtpin.diagnosis.priors import LIKELY, SURE
from gtpin.diagnosis.result import Diagnosis


@dataclass(frozen=True)
class Longer(Closures):
    """Rods that are longer by ``more`` (N, 6), m."""

    more: Floats | None = None

    def L(self, q: Floats) -> Floats:
        return super().L(q) + self.more


@dataclass(frozen=True)
class Drawn:
    """A Gantry-Tau off by a third of its tolerances, at so many commands."""

    rng: np.random.Generator
    machine: Closures
    q: Floats
    T: Floats
    R: Floats

    @staticmethod
    def of(seed: int, count: int) -> "Drawn":
        rng, plain = np.random.default_rng(seed), nominal("gantry_tau")
        machine = plain.off({name: rng.normal(0.0, 0.3 * size) for name, size in plain.parameters().items()})
        q = machine.in_range(rng, count)
        return Drawn(rng, machine, q, *machine.follow(q))

    def diagnosed(self, rod: int, longer: Floats) -> Diagnosis:
        """Where a rod is ``longer`` (N,), m."""
        more = longer[:, None] * np.eye(6)[rod]
        T, R = Longer(**vars(self.machine), more=more).close(self.q, self.T, self.R)
        turn = Rotation.from_rotvec(self.rng.normal(0.0, ORIENTATION_SIGMA, (len(T), 3))) * Rotation.from_matrix(R)
        return quietly(
            gtpin.diagnose,
            gtpin.Dataset(
                "gantry_tau",
                np.array([f"p{n}" for n in range(len(T))]),
                self.q,
                T + self.rng.normal(0.0, POSITION_SIGMA, T.shape),
                turn.as_quat(scalar_first=True),
                instrument=InstrumentSection(position_sigma=POSITION_SIGMA, orientation_sigma=ORIENTATION_SIGMA),
            ),
        )


def bracket(q: Floats, carts: tuple[int, int], size: float) -> Floats:
    """(N,) smooth step where both carts are beyond a place, m."""
    return size * np.prod([1.0 / (1.0 + np.exp(-(q[:, j] - np.quantile(q[:, j], 0.4)) / 0.08)) for j in carts], axis=0)


def out_of_round(drawn: Drawn, rod: int, size: float) -> tuple[Floats, float]:
    """(N,) harmonics of the rod's direction of root mean square ``size``, m; and this about the best sphere, over the poses."""
    d = drawn.T + drawn.machine.P[rod] @ np.swapaxes(drawn.R, 1, 2) - drawn.machine.C(drawn.q)[:, rod]
    along = d / np.linalg.norm(d, axis=1)[:, None]
    mean = along.mean(axis=0) / np.linalg.norm(along.mean(axis=0))
    f = np.zeros(len(d))
    for order in range(2, 9):
        across = drawn.rng.standard_normal(3)
        across -= (across @ mean) * mean
        angle = np.arctan2(along @ across / np.linalg.norm(across), along @ mean)
        f += drawn.rng.normal(0.0, order**-0.5) * np.cos(order * angle + drawn.rng.uniform(0.0, 2.0 * np.pi))
    f *= size / f.std()
    sphere = np.column_stack([np.ones(len(f)), along])
    return f, float((f - sphere @ np.linalg.lstsq(sphere, f, rcond=None)[0]).std())


@pytest.mark.parametrize(
    ("rod", "carts"),
    [
        (1, (0, 1)),
        (4, (1, 2)),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((2, (0, 2)), (3, (0, 1)), (5, (1, 2)))),
    ],
)
def test_a_rod_that_a_bracket_pushes_is_unknown_at_this_rod(rod, carts):
    drawn = Drawn.of(7, 120)
    found = drawn.diagnosed(rod, bracket(drawn.q, carts, 8e-5))
    assert [doubt.site for doubt in found.doubts] == [drawn.machine.rods[rod]]
    assert not found.causes


@pytest.mark.slow
@pytest.mark.parametrize(("rod", "cart"), [(1, 1), (2, 1), (3, 2), (5, 2)])
def test_a_rod_that_is_pushed_along_its_own_cart_is_no_rotation_of_the_cart(rod, cart):
    """A ramp of 0.1 m from the last third of the cart's travel on."""
    drawn = Drawn.of(9, 160)
    ramp = np.clip((drawn.q[:, cart] - np.quantile(drawn.q[:, cart], 0.65)) / 0.1, 0.0, 1.0)
    found = drawn.diagnosed(rod, 8e-5 * ramp)
    assert found.verdict == "unknown"
    assert not [cause for cause in found.causes if cause.probability >= SURE]


@pytest.mark.parametrize("seed", [1011, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1017, 1022, 1023))])
def test_a_ball_that_is_out_of_round_is_named_with_its_form(seed):
    drawn = Drawn.of(seed, 150)
    rod = int(drawn.rng.integers(6))
    f, true = out_of_round(drawn, rod, 6e-5)
    found = drawn.diagnosed(rod, f)
    assert [(one.effect, one.site) for one in found.causes] == [("joint_runout", drawn.machine.rods[rod])]
    assert found.causes[0].probability >= SURE
    assert found.causes[0].parameters["rms"].value == pytest.approx(true, rel=0.5)


def test_a_cause_that_explains_nothing_of_what_is_stated_is_stated_as_unlikely():
    """Where the verdict leaves a cause open, so does its probability on the page."""
    drawn = Drawn.of(7, 120)
    found = drawn.diagnosed(5, bracket(drawn.q, (0, 2), 8e-5))
    for cause in found.causes:
        assert cause.explained_fraction > 0.0 or cause.probability < LIKELY
