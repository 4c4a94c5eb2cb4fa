"""Two different mechanisms of an arm on a telescope, one above the other, with no error that is not listed."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import telescope_arm as world
from diagnosed import quietly

import gtpin
from gtpin.diagnosis.result import Diagnosis

TRIED = "joint_compliance bearing_compliance cart_compliance link_compliance axis_motion tracker_drift encoder_scale"
PLACES = {
    "column": ("cart_compliance", "lift"),
    "base": ("bearing_compliance", "lift"),
    "bearing": ("bearing_compliance", "pan"),
}
SIZE, SIGMA, POSES = 1.0e-3, 1.0e-4, 150
"""Root mean square at the TCP, m, of each mechanism; noise, m; and number of poses."""
NOTHING = np.zeros((2, 2))


def machine(parts: tuple[str, ...], q: np.ndarray, rng: np.random.Generator) -> world.Machine:
    """A machine in which each part moves the TCP by ``SIZE`` of what a machine with rigid parts does not."""
    time, errors, rough = np.arange(len(q), dtype=float), np.zeros((8, 6)), np.zeros((len(q), 6))
    rigid, sizes = world.frames(q, errors)[-1][1], {}
    J = world.derivative(q)
    for part in parts:
        step = {part: 1e-6 * world.spd(rng, rng.uniform(0.2, 0.8))}
        one = world.Machine(**({"base": NOTHING, "column": NOTHING} | step))
        moved = (world.seen(q, time, errors, one, rough) - rigid).ravel()
        left = moved - J @ np.linalg.lstsq(J, moved, rcond=1e-8)[0]
        sizes[part] = SIZE / world.rms(left) * step[part]
    return world.Machine(**({"base": NOTHING, "column": NOTHING} | sizes))


@cache
def said(parts: tuple[str, ...], seed: int, base: float = 1.0, column: float = 1.0) -> tuple[Diagnosis, world.Machine]:
    """``base``, ``column``: factors of the sizes of these parts."""
    rng = np.random.default_rng(seed)
    low, high = np.array(world.TRAVEL).T
    q = np.round(rng.uniform(low, high, (POSES, len(low))), 6)
    time, errors = np.cumsum(rng.uniform(10.0, 30.0, POSES)), world.TOLERANCE * rng.standard_normal((8, 6))
    real = machine(parts, q, rng)
    real = replace(real, base=base * real.base, column=column * real.column)
    exact = world.seen(q, time, errors, real, np.zeros((POSES, 6)))
    with TemporaryDirectory() as folder:
        dataset = gtpin.Dataset(
            str(world.write(Path(folder))),
            np.array([f"p{n}" for n in range(POSES)]),
            q,
            exact + SIGMA * rng.standard_normal(exact.shape),
            None,
            {"time": time},
            {"position_sigma": SIGMA, "frame": "free"},
        )
        found = quietly(gtpin.diagnose, dataset, effects=[e for e in gtpin.catalogue() if e.id in TRIED.split()])
    return found, real


def held(found: Diagnosis) -> set[tuple[str, str]]:
    return {(member.effect, member.site) for cause in found.causes for member in cause.members}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("parts", [("column", "bearing"), ("base", "bearing"), ("column", "base")])
def test_two_mechanisms_that_carry_one_moment_are_both_in_a_class(parts: tuple[str, str], seed: int) -> None:
    found, _ = said(parts, seed)
    assert {PLACES[part] for part in parts} <= held(found), found.causes
    certain = {(cause.effect, cause.site) for cause in found.causes if cause.probability >= 0.9}
    assert certain <= {PLACES[part] for part in parts}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("part", ["column", "base", "bearing"])
def test_one_mechanism_has_no_certain_second_one(part: str, seed: int) -> None:
    found, _ = said((part,), seed)
    assert PLACES[part] in held(found)
    assert all((one.effect, one.site) == PLACES[part] for one in found.causes if one.probability >= 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("base", "column"), [(1.0, 0.3), (0.3, 1.0)])
def test_a_size_contains_what_it_would_be_beside_the_other_part(base: float, column: float, seed: int) -> None:
    """Where the data leave open whether base and column both give way: alone, the larger one takes up the other's part."""
    found, real = said(("column", "base"), seed, base, column)
    true = {"tilt": np.trace(real.base) / 2.0, "bending": np.trace(real.column) / 2.0}
    sizes = [(name, e) for cause in found.causes for name, e in cause.parameters.items() if name in true]
    assert sizes
    for name, e in sizes:
        assert abs(e.value - true[name]) < 2.6 * e.sigma
        assert e.sigma < true[name]
