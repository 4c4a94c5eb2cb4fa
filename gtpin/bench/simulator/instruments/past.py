"""E of an effect for any instruments: the whitened energy of its changes of their readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve

from gtpin.bench.simulator.instruments.gauge import Gauge
from gtpin.bench.simulator.poses import Poses
from gtpin.typing import Floats

FREE = 3.0
"""Prior sigma of unknowns of which nothing is known, m and rad: so large that it has no influence."""


@dataclass(frozen=True)
class PastReadings:
    """Computes E of displacements (N, 6 + k) of the poses and of the k joints that encoders read.

    E = d' (I + B B')^-1 d, with d the whitened change of the readings.

    Parameters
    ----------
    H
        For each instrument: the stops of its rows (M,), and the whitened derivative (M, c, 6 + k) of its readings by poses and
        joints.
    B
        (K, p) whitened derivative of all K readings by the geometry, in units of the tolerances, and by the instruments'
        unknowns, in units of their prior sigmas.
    """

    H: tuple[tuple[npt.NDArray[np.int_], Floats], ...]
    B: Floats

    @staticmethod
    def of(gauges: Sequence[Gauge], poses: Poses, by_tolerance: Floats, jitter: Floats) -> PastReadings:
        """For ``poses`` (N) at all stops.

        Parameters
        ----------
        by_tolerance
            (N, 6 + k, p) derivative of poses and joints by the geometry, in units of the tolerances.
        jitter
            (N, 6 + k, n) motions of poses and joints by 1 sigma of each actuator's repeatability. They are added to the noise,
            because some instruments are more precise than the machine.
        """
        H, blocks = [], []
        own = [len(gauge.hidden) for gauge in gauges]
        for i, gauge in enumerate(gauges):
            here = poses[gauge.stop]
            plain = gauge.by_motion(here)
            sigma = np.sqrt(gauge.sigma**2 + ((plain @ jitter[gauge.stop]) ** 2).sum(axis=2))[..., None]
            slope = plain / sigma
            priors = np.array([min(one.prior, FREE) for one in gauge.hidden])
            hidden = np.zeros((*gauge.sigma.shape, sum(own)))
            hidden[..., sum(own[:i]) : sum(own[: i + 1])] = gauge.by_hidden(here) * priors / sigma
            block = np.concatenate([slope @ by_tolerance[gauge.stop], hidden], axis=2)
            H.append((gauge.stop, slope))
            blocks.append(block.reshape(-1, block.shape[2]))
        return PastReadings(tuple(H), np.vstack(blocks))

    def whitened(self, displacement: Floats) -> Floats:
        """(K,) whitened change of all readings by a displacement (N, 6 + k) of the stops, m and rad."""
        return np.concatenate([np.einsum("mci,mi->mc", slope, displacement[stop]).ravel() for stop, slope in self.H])

    def energy(self, displacement: Floats) -> float:
        """E of a displacement (N, 6 + k), by Woodbury's identity."""
        d = self.whitened(displacement)
        projected = self.B.T @ d
        absorbed = projected @ cho_solve(cho_factor(np.eye(len(projected)) + self.B.T @ self.B), projected)
        return float(d @ d - absorbed)
