"""Poses of a machine with all its errors; and E, the whitened energy of an effect that the geometry can't absorb."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from gtpin.bench.simulator.arm_machine import ArmMachine
from gtpin.bench.simulator.causes.kinds import PlantedCause, kind, listed
from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.machine import Deviation
from gtpin.bench.simulator.poses import VirtualPoses, exp
from gtpin.bench.simulator.recipe import Machine, Recipe
from gtpin.bench.simulator.situation import ArmSituation, RodSituation
from gtpin.bench.simulator.truth import EffectTruth
from gtpin.bench.simulator.visits import VirtualVisits
from gtpin.errors import ConvergenceError
from gtpin.typing import Floats, Ints

Active = Sequence[tuple[PlantedCause, float]]
"""Causes with their amplitudes, in multiples of their typical sizes."""

ROUNDS = 8
SETTLED = 1e-10
"""Change of a pose, m or rad, below which the iteration of forces and deflections ends."""


@dataclass(frozen=True)
class Response:
    """A machine, its visits of a day, and the instrument that measures them."""

    machine: Machine
    visits: VirtualVisits  # All visits are solved together, because effects can depend on earlier ones
    station: Floats  # (3,) position of the instrument, base frame, m
    read: tuple[str, ...] = ()  # Names of the joints that encoders read

    @cached_property
    def ideal(self) -> RodSituation | ArmSituation:
        """The machine with errors of its geometry alone."""
        if isinstance(self.machine, ArmMachine):
            return ArmSituation.of(self.machine, self.visits)
        return RodSituation.of(self.machine, self.visits)

    @cached_property
    def there(self) -> VirtualPoses:
        """(N) poses of this machine without effects, base frame, with the coordinates of the joints ``read``."""
        return self.ideal.seen(self.read)

    def at(self, q: Floats) -> Response:
        """The response at other commands q (N, n); the last moves start elsewhere too, so that they keep their directions."""
        visits = self.visits
        return replace(self, visits=replace(visits, q=q, before=visits.before + (q - visits.q)))

    def settled(self, active: Active, jitter: Deviation | None = None) -> tuple[Any, Deviation]:
        """The situation with some causes and with ``jitter``, random deviations by the repeatability; and the total deviation.

        Raises ConvergenceError if the iteration of forces and deflections does not converge.
        """
        now = self.ideal
        for _ in range(ROUNDS):
            deviation = now.unbent() if jitter is None else jitter
            for cause, amplitude in active:
                deviation = deviation + cause(now) * amplitude
            before, now = now, now.settled_by(deviation)
            if np.abs(now.poses.minus(before.poses)).max() < SETTLED:
                return now, deviation
        raise ConvergenceError("the machine does not come to rest", hint="make the effects smaller")

    def seen(self, active: Active, jitter: Deviation | None = None) -> VirtualPoses:
        """(N) poses that the instrument reads without noise, base frame, with the coordinates of the joints ``read``."""
        now, deviation = self.settled(active, jitter)
        T = now.poses.T + np.einsum("nij,nj->ni", now.poses.R, deviation.target) - self.station
        turn = exp(deviation.frame[:, 3:])
        T = (1.0 + deviation.scale)[:, None] * np.einsum("nij,nj->ni", turn, T) + deviation.frame[:, :3]
        return VirtualPoses(T + self.station, turn @ now.poses.R, now.seen(self.read).joints)

    def displacement(self, active: Active) -> Floats:
        """(N, 6 + k) displacement by causes alone of the measured poses, m and rad, base frame, and of the joints ``read``."""
        return self.seen(active).change(self.there)


FREE = 3.0
"""Prior sigma of unknowns of which nothing is known, m and rad: so large that it has no influence."""
MOST = 2.0
"""Largest amplitude of a weak effect, in typical sizes: one with little energy is not made larger."""


@dataclass(frozen=True)
class Past:
    """Computes E = d' (I + B B')^-1 d of displacements (N, 6 + k) of the poses, m and rad, base frame, and of k joints.

    d is the whitened change of everything that was measured.
    """

    # For each instrument: the stops of its rows (M,), and the whitened derivative (M, c, 6 + k) of its readings by
    # poses and joints; or the sigmas (6,), m and rad, of poses that are measured themselves
    H: tuple[tuple[Ints, Floats], ...] | Floats
    # (K, p) whitened derivative of all K numbers by the geometry and the instruments' unknowns, in units of the tolerances
    # and of the prior sigmas
    B: Floats

    @staticmethod
    def of_poses(machine: Machine, q: Floats, poses: VirtualPoses, sigma: Floats) -> Past:
        """For poses (N) of a machine at commands q (N, n), measured with the sigmas (6,)."""
        return Past(sigma, (machine.by_tolerance(q, poses) / sigma[:, None]).reshape(6 * len(q), -1))

    @staticmethod
    def of_readings(gauges: Sequence[Gauge], poses: VirtualPoses, by_tolerance: Floats, jitter: Floats) -> Past:
        """For instruments, and ``poses`` (N) at all stops.

        ``by_tolerance``: (N, 6 + k, p) as :meth:`~gtpin.bench.simulator.rod_machine.RodMachine.by_tolerance` gives it.
        ``jitter``:
        (N, 6 + k, n) motions of poses and joints by 1 sigma of each actuator's repeatability. They are added to the noise,
        because some instruments are more precise than the machine.
        """
        H, blocks = [], []
        own = [len(gauge.hidden) for gauge in gauges]
        for i, gauge in enumerate(gauges):
            here = poses[gauge.stop]
            plain = gauge.by_motion(here)
            sigma = gauge.scattered(plain, jitter[gauge.stop])[..., None]
            slope = plain / sigma
            priors = np.array([min(one.prior, FREE) for one in gauge.hidden])
            hidden = np.zeros((*gauge.sigma.shape, sum(own)))
            hidden[..., sum(own[:i]) : sum(own[: i + 1])] = gauge.by_hidden(here) * priors / sigma
            block = np.concatenate([slope @ by_tolerance[gauge.stop], hidden], axis=2)
            H.append((gauge.stop, slope))
            blocks.append(block.reshape(-1, block.shape[2]))
        return Past(tuple(H), np.vstack(blocks))

    def whitened(self, displacement: Floats) -> Floats:
        """(K,) whitened change of all numbers by a displacement (N, 6 + k) of the stops, m and rad."""
        if not isinstance(self.H, tuple):
            return np.asarray((displacement / self.H).ravel())
        return np.concatenate([np.einsum("mci,mi->mc", slope, displacement[stop]).ravel() for stop, slope in self.H])

    def noncentrality(self, displacement: Floats) -> float:
        """E of a displacement (N, 6 + k), by Woodbury's identity."""
        d = self.whitened(displacement)
        projected = self.B.T @ d
        absorbed = projected @ cho_solve(cho_factor(np.eye(len(projected)) + self.B.T @ self.B), projected)
        return float(d @ d - absorbed)


def effects_of(
    recipe: Recipe, response: Response, rows: Ints, past: Past, rng: np.random.Generator
) -> tuple[list[tuple[PlantedCause, float]], list[EffectTruth], list[tuple[PlantedCause, float]], float]:
    """The effects of a recipe at some of the visits.

    Returns ``strong``, ``truths``: those that it asks for, with their amplitudes, and the truth about them. ``weak``,
    ``energy``: further effects at other sites, with their amplitudes, and their joint E.
    """
    strong, truths = [], []
    robot = response.machine.robot
    parts = np.random.SeedSequence([recipe.seed, 2]).spawn(len(recipe.wanted))
    for want, part in zip(recipe.wanted, parts, strict=True):
        found = kind(want.effect, robot)
        cause = found.at(robot, want.site, np.random.default_rng(part), want.periods)
        amplitude = 1.0 if want.amplitude is None else want.amplitude
        if want.noncentrality is not None:
            amplitude = amplitude_for(response, cause, rows, past, want.noncentrality, found.largest)
        displacement = response.displacement([(cause, amplitude)])[rows]
        strong.append((cause, amplitude))
        truths.append(EffectTruth(want.effect, want.site, past.noncentrality(displacement), amplitude, displacement))
    if not recipe.background:
        return strong, truths, [], 0.0
    taken = {(want.effect, want.site) for want in recipe.wanted}
    return strong, truths, *weak_others(response, rows, past, taken, rng)


def amplitude_for(
    response: Response, cause: PlantedCause, rows: Ints, past: Past, noncentrality: float, largest: float
) -> float:
    """Amplitude of a cause, in typical sizes, at which it has an E at the visits ``rows``; at most ``largest``."""
    amplitude = 1.0
    for _ in range(6):
        reached = past.noncentrality(response.displacement([(cause, amplitude)])[rows])
        if abs(reached - noncentrality) <= 1e-3 * noncentrality:
            break
        # The energy is almost proportional to the square of the amplitude.
        wanted = amplitude * np.sqrt(noncentrality / reached) if reached > 0.0 else largest
        if wanted >= largest and amplitude == largest:
            break
        amplitude = float(min(wanted, largest))
    return amplitude


def weak_others(
    response: Response, rows: Ints, past: Past, taken: Collection[tuple[str, str]], rng: np.random.Generator
) -> tuple[list[tuple[PlantedCause, float]], float]:
    """Some weak effects, with their amplitudes, and their joint E; ``taken``: effects and sites of the strong ones."""
    causes, shares, displaced = [], [], []
    robot = response.machine.robot
    kinds = [one for one in listed(robot) if not one.newer]
    for i in rng.choice(len(kinds), size=int(rng.integers(2, 6)), replace=False):
        site = str(rng.choice(kinds[i].sites(robot)))
        if (kinds[i].name, site) in taken:
            continue
        cause = kinds[i].at(robot, site, rng)
        cause(response.ideal, rng)  # the numbers that follow are drawn after those of the cause
        displacement = response.displacement([(cause, 1.0)])[rows]
        share = float(min(np.sqrt(rng.exponential() / max(past.noncentrality(displacement), 1e-9)), MOST))
        causes.append(cause)
        shares.append(share)
        displaced.append(share * displacement)
    wanted = float(rng.uniform(*((2.0, 12.0) if taken else (0.5, 4.0))))  # too weak to be detected
    if not causes:
        return [], 0.0
    whole = past.noncentrality(np.sum(displaced, axis=0))
    factor = min(np.sqrt(wanted / max(whole, 1e-9)), MOST / max(shares))
    active = [(cause, share * factor) for cause, share in zip(causes, shares, strict=True)]
    return active, past.noncentrality(response.displacement(active)[rows])
