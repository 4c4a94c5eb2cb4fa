"""How often a certificate's uncertainty covers the true error of a corrected machine: ``[MACHINES] [FIRST]``.

Machines of the plant with one effect at random, weak other effects and scatter of the drives; their poses are diagnosed and
certified. The true errors are at 120 poses that were not measured, each with the scatter of the drives.
"""

from __future__ import annotations

import sys
import warnings

import numpy as np
import numpy.typing as npt

import gtpin
from gtpin.bench.simulator import Case, make_case
from gtpin.bench.simulator.build import assemble
from gtpin.bench.simulator.recipe import SimulatedNoise


def true_errors(case: Case, model: gtpin.Model, seed: int) -> npt.NDArray[np.float64]:
    """(N, 3) position errors of the corrected machine at the poses that were not measured, m."""
    q = case.commands.q
    J = model.kinematics.command_jacobian(q, model.kinematics.forward(q))[:, :3]
    scatter = assemble(case.recipe).repeatability * np.random.default_rng(seed).standard_normal(q.shape)
    error = case.truth.T - model.predict(q, case.commands.covariates).T
    return np.asarray(error + np.einsum("nij,nj->ni", model.frame.R @ J, scatter))


def covered(certificate: gtpin.Certificate, error: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Shares of errors (N, 3) within the expanded uncertainty of their axis, and within the radius."""
    budget = certificate.budget
    lengths = np.linalg.norm(error, axis=1)
    return float((np.abs(error) <= 2.0 * budget.combined[:3]).mean()), float((lengths <= budget.radius).mean())


def of_machines(count: int, first: int = 0) -> npt.NDArray[np.float64]:
    """(count, 2) shares by machine; half of them with an instrument in a frame of its own."""
    found = []
    for seed in range(first, first + count):
        case = make_case(seed, poses=140, held_out=120, noise=SimulatedNoise(free=seed % 2 == 1))
        certificate = gtpin.certify(case.dataset)
        found.append(covered(certificate, true_errors(case, certificate.model, seed)))
    return np.array(found)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    numbers = [int(word) for word in sys.argv[1:]]
    shares = of_machines(*(numbers or [20]))
    print(f"{len(shares)} machines: axes {shares[:, 0].mean():.3f}, radius {shares[:, 1].mean():.3f}")
    print(f"the worst machine: axes {shares[:, 0].min():.3f}, radius {shares[:, 1].min():.3f}")
