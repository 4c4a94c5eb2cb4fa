"""A calibration as plain text."""

from __future__ import annotations

import numpy as np

from gtpin.calibration.result import Calibration
from gtpin.report.quality import cannot_judge, error_of, noise_words, scatters
from gtpin.report.unseen_words import grouped

HEAVY = 1.5
"""Chi-square per degree of freedom above which heavy tails get a warning."""
ZEROS = """\
The zero of a drive is not a separate parameter: a shifted zero moves all that the drive carries equally, and is part of
the values above. Their common shift, as a shift of the zero (at drive position 0)"""
"""Explanation of the drives' zeros in the report."""
SHOWN = 8
"""Largest number of listed correlations and unobservable directions."""


def calibration_text(calibration: Calibration) -> str:
    """The report of a calibration: fit, noise, parameters, unobservable directions, correlations."""
    parts = (_fit, _noise, _parameters, _unobservable, _correlations)
    return "\n\n".join(part(calibration) for part in parts) + "\n"


def calibration_summary(calibration: Calibration) -> str:
    """The fit, the noise, and the number of observable directions, for a terminal."""
    number = len(calibration.names)
    seen = number - len(calibration.unobservable)
    observed = f"The data determine {seen} of {number} directions of the geometry; the others keep their prior means."
    return "\n\n".join((_fit(calibration), _noise(calibration), observed)) + "\n"


def _fit(c: Calibration) -> str:
    lines = [f"Calibration of {c.model.robot.name}: {len(c.names)} parameters from {c.poses} measurements"]
    for one in c.by_instrument:
        unit = f"u{one.unit}"
        before, after, out, noise = (f"{1e6 * v:.1f} {unit}" for v in (one.before, one.after, one.left_out, one.floor))
        lines.append(f"  {error_of(one) + ', RMS':<33} {before} nominal -> {after} calibrated")
        lines.append(f"    {'at poses left out of the fit':<31} {out}")
        noise = noise if c.noise_known else "not known: declare it, or repeat visits"
        lines.append(f"    {'noise alone':<31} {noise}")
    spread = np.sqrt(2.0 / c.dof)
    meaning = cannot_judge(c) or f"1 +- {spread:.2f} if it fits"
    lines.append(f"  chi-square per degree of freedom  {c.chi2_per_dof:.2f}  ({meaning})")
    lines.append(f"  degrees of freedom                {c.dof:.1f}")
    lines.append(f"  iterations                        {c.iterations}")
    if c.rejected:
        lines.append(f"  set aside                         {', '.join(c.rejected)}")
    if c.enlarged > 1.0:
        lines.append(
            f"  The mean residuals of the poses are {c.enlarged:.2f} times their noise: the geometry does not explain these\n"
            "  data. Sigmas below are enlarged accordingly."
        )
    return "\n".join(lines)


def _noise(c: Calibration) -> str:
    noise = c.noise
    lines = ["Noise of the instruments, 1 sigma of a number", *(f"  {words}" for words in noise_words(c))]
    if noise.sight is not None:
        lines.append(f"  along the line of sight {noise.range_ratio:.2f} times that across it at the mean range")
    if noise.repeatability > 0.0:
        how = "the residuals" if noise.source == "residuals" else "repeated visits"
        lines.append(f"  repeatability of each actuator, from {how}: {noise.repeatability * 1e6:.2f} um or urad")
    if noise.lack > 0.0:
        lines.append(
            f"  model error along single drives, correlated between neighbouring poses: {noise.lack * 1e6:.2f} um or urad"
        )
    if scatters(c):
        lines.append(
            "  That is large: backlash and other effects that vary between visits may be part of it. gtpin diagnose tests this."
        )
    if np.isfinite(c.freedom):
        lines.append(f"  tails heavier than Gaussian: t distribution with {c.freedom:g} degrees of freedom")
        if c.chi2_per_dof > HEAVY:
            lines.append("  Either the noise has such tails, or the geometry is incomplete: compare chi-square above.")
    return "\n".join(lines)


def _unknowns(c: Calibration) -> list[str]:
    """Rows of the instruments' unknowns, as those of parameters."""
    lines = ["", f"  {'unknown of an instrument':<26}{'value':>13}{'sigma':>11}{'- declared':>12}{'prior':>11}"]
    for one, deviation in zip(c.unknowns, c.u, strict=True):
        e = c.unknown(one.name)
        prior = f"{one.sigma:.1e}" if np.isfinite(one.sigma) else "none"
        lines.append(f"  {one.name:<26}{e.value:>13.7f}{e.sigma:>11.2e}{deviation:>+12.2e}{prior:>11}  {one.unit}")
    return lines


def _parameters(c: Calibration) -> str:
    lines = [
        "Parameters (reduction: variance reduction 1 - (sigma / tolerance)^2; 0 is no information beyond the tolerance)",
        f"  {'name':<26}{'value':>13}{'sigma':>11}{'- nominal':>12}{'tolerance':>11}  {'unit':<5}{'reduction':>10}",
    ]
    for p, value, sigma, reduction in zip(
        c.model.geometry.parameters, c.values, c.sigma, c.variance_reduction, strict=True
    ):
        lines.append(
            f"  {p.name:<26}{value:>13.7f}{sigma:>11.2e}{value - p.nominal:>+12.2e}{p.tolerance:>11.1e}  {p.unit:<5}"
            f"{reduction:>10.3f}"
        )
    if c.unknowns:
        lines += _unknowns(c)
    if c.zeros:
        lines += ["", ZEROS, f"  {'drive':<26}{'zero':>13}{'sigma':>11}"]
        lines += [f"  {z.site:<26}{z.value:>+13.7f}{z.sigma:>11.2e}  {z.unit}" for z in c.zeros]
    return "\n".join(lines)


def _unobservable(c: Calibration) -> str:
    directions = c.unobservable
    if not directions:
        return "The data determine every direction of the geometry."
    lines = [
        f"{len(directions)} of {len(c.names)} directions of the geometry are hardly observable with these data; their values "
        "are\nthe prior means, and change no prediction near the measured poses (weights in tolerances)"
    ]
    for direction in directions[:SHOWN]:
        terms = " ".join(f"{weight:+.2f} {name}" for name, weight in list(direction.weights.items())[:5])
        lines.append(
            f"  variance reduction {direction.variance_reduction:.3f}  {terms}{' ...' if len(direction.weights) > 5 else ''}"
        )
    lines += [f"  {sentence}" for sentence in grouped(c.words, c.remedies)[:SHOWN]]
    if len(directions) > SHOWN:
        lines.append(f"  and {len(directions) - SHOWN} more in calibration.json")
    indices = ", ".join(f"{name} {value:.3g}" for name, value in c.observability.indices.items())
    lines.append(f"Observability indices: {indices}")
    return "\n".join(lines)


def _correlations(c: Calibration) -> str:
    pairs = c.correlated()
    if not pairs:
        return "No two parameters are correlated by more than 0.7."
    lines = [f"Correlations of at least 0.7: {len(pairs)}"]
    lines += [f"  {rho:+.3f}  {a}  {b}" for a, b, rho in pairs[:SHOWN]]
    if len(pairs) > SHOWN:
        lines.append(f"  and {len(pairs) - SHOWN} more in calibration.json")
    return "\n".join(lines)
