"""A calibration in words: its errors, its noise, and the directions that it can't see."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gtpin.accuracy.expected import Uncertainty, expected_rms, response, unexplained_error
from gtpin.accuracy.workspace import FLAT, default_commands
from gtpin.calibration.observability import Remedy
from gtpin.calibration.result import Calibration, InstrumentFit
from gtpin.data.instrument_tables import TrackerTable
from gtpin.data.names import SIGMAS
from gtpin.diagnosis.priors import PRIORS
from gtpin.errors import UnreachableError
from gtpin.report.words import joined, length, quantity
from gtpin.robot.geometry import Geometry
from gtpin.typing import Floats

SHOWN = 8
"""Largest number of listed correlations and unobservable directions."""
SOURCES = {"declared": "as declared", "repeats": "from repeated visits", "residuals": "from the residuals"}
WHAT = {
    "touches": "touches of a plane whose normal is along {axis}",
    "distances": "distances from one station, by a draw wire or a ball bar,",
    "tilts": "readings of a tilt sensor",
    "positions": "positions, by a camera or a tracker,",
    "poses": "positions and orientations, by a tracker,",
}
"""Measurements in words."""
ALONG = 0.9
"""Smallest absolute cosine between a direction and that in which all lengths grow in proportion, or a single parameter's
direction, for which the sentence names this growth or this parameter alone. Assumed."""


def elsewhere(c: Calibration) -> list[str]:
    """Where the error at left-out poses holds, and what the posterior of the parameters, with their priors, lets expect in the
    rest of the workspace: a sentence, where that is more."""
    try:
        q = default_commands(c.model)
        found = response(c.model, q, Uncertainty(c.covariance))
    except UnreachableError:
        return []
    expected, place = (float(np.sqrt((part[:, :3] ** 2).sum() / len(q))) for part in (found.fixed, found.place))
    seen = [one.left_out for one in c.by_instrument if one.kind == "tracker" and one.unit == "m"]
    if not seen or expected <= max(seen):
        return []
    kinematics = c.model.kinematics
    left = unexplained_error(c.model, kinematics.command_jacobian(q, kinematics.forward(q)))[0]
    known = c.model.unexplained is None or c.model.unexplained.noise_known
    expected = expected_rms(expected**2, 3.0 * left**2, noise_known=known)
    poses = c.model.predict(c.dataset.q[c.used(c.dataset)]).T
    sizes = np.ptp(poses, axis=0)
    box = " x ".join(f"{size:.2g}" for size in sizes[sizes > FLAT * sizes.max()])
    where = f", beside where the machine stands ({length(place)}), which no instrument shows" if place > 0.0 else ""
    return [
        f"The left-out poses are in a box of {box} m. "
        f"In the rest of the workspace, expect an error of {length(expected)}{where}."
    ]


def exact_scales(c: Calibration) -> list[str]:
    """That the scales of the drives are no parameters, where a robot with rods could have them: a sentence."""
    geometry = c.model.geometry
    if not geometry.robot.rods or any(p.drive is not None for p, _ in geometry.all_deviations):
        return []
    return [
        "The scales of the drives are taken as exact: other parameters take up their errors, and no sigma contains them. In "
        'Python calibrate(dataset, scale="actuator") identifies them too.'
    ]


def lost(c: Calibration) -> list[InstrumentFit]:
    """The errors that the calibrated geometry makes larger at poses left out of the fit, and larger than noise."""
    return [one for one in c.by_instrument if one.left_out > max(one.before, PRIORS.silent * one.floor)]


def best_frame(c: Calibration) -> str:
    """That the error of the nominal geometry is after a fit of the instrument's frame, where that is free, or of other unknowns
    of the instruments; or nothing."""
    trackers = [one.table for one in c.model.instruments if isinstance(one.table, TrackerTable)]
    free = not c.model.frame.is_base or any(table.frame == "free" for table in trackers)
    if free:
        return f" after the best fit of the frame{' and the target' * bool(c.model.free_target)}"
    return " after the best fit of the instruments' unknowns" if c.unknowns else ""


def nominal_words(c: Calibration) -> str:
    """Errors of the nominal geometry, RMS, in words."""
    named = sum(bool(one.name) for one in c.by_instrument) > 1
    errors = [one for one in c.by_instrument if one.name or one.unit == "m"]
    return joined([f"{quantity(b.before, b.unit)}{f' ({b.name})' if named else ''}" for b in errors])


def _measured_by(c: Calibration) -> list[str]:
    several = {name for name, unit in c.sigmas if {unit} != {of for other, of in c.sigmas if other == name}}
    of_pose = {"m": "position", "rad": "orientation"}
    names = [f"{n} ({of_pose[unit]})" if n in several and n else n or of_pose[unit] for n, unit in c.sigmas]
    # Only sockets have two sigmas of one unit.
    return [f"known distances of {name}" if name in names[:k] else name for k, name in enumerate(names)]


def overruled(c: Calibration) -> list[float | None]:
    """By sigma: the declared one, m or rad, where these data show another and it was not used; else None."""
    rows, turns = c.dataset.readings, [unit == "rad" for _, unit in c.sigmas]
    found: list[float | None] = []
    for (name, _), turn, estimated in zip(c.sigmas, turns, c.noise.estimated, strict=True):
        i = next(i for i, table in enumerate(rows.tables) if table.name == name)
        keys = ("orientation_sigma" if turn else "position_sigma", "sigma")
        columns = [rows.columns[s][rows.rows_of(i)] for s in SIGMAS[3 * turn :][:3] if s in rows.columns]
        values = [getattr(rows.tables[i], key, None) for key in keys]
        values += [float(np.median(column)) for column in columns if np.isfinite(column).all()]
        found.append(next((v for v in values if v is not None), None) if estimated else None)
    return found


def visits_over_declared(c: Calibration) -> float:
    """The largest ratio of the noise that repeated visits show to a declared sigma that they contradict; else 1."""
    if c.noise.source != "repeats":
        return 1.0
    return max([1.0, *(float(s) / own for s, own in zip(c.noise.sigma, overruled(c), strict=True) if own)])


def noise_words(c: Calibration) -> list[str]:
    """The sigma of each kind of numbers, in words, and where it comes from."""
    sigmas = zip(_measured_by(c), c.noise.sigma, c.sigmas, c.noise.estimated, overruled(c), strict=True)
    return [
        f"{what} {quantity(float(sigma), unit)}, {SOURCES[c.noise.source if estimated else 'declared']}"
        f"{f' ({quantity(declared, unit)} was declared)' if declared else ''}"
        for what, sigma, (_, unit), estimated, declared in sigmas
    ]


def repeatability_words(c: Calibration) -> str:
    """The repeatability of each actuator, m or rad."""
    turn = {actuator.revolute for actuator in c.model.robot.actuators}
    sizes = {True: quantity(c.noise.repeatability, "rad"), False: quantity(c.noise.repeatability, "m")}
    return " or ".join(words for of, words in sizes.items() if of in turn)


def scatters(c: Calibration) -> str:
    """Warning that a large scatter of the drives may come from effects in part; empty if the scatter is small."""
    if c.drive_scatter <= PRIORS.scatters:
        return ""
    return (
        f"Repeated visits scatter by {repeatability_words(c)} at each actuator. A calibration counts this as noise, but "
        "backlash and other effects that vary between visits can be part of it. A diagnosis tests this if directions of "
        "approach and speeds were recorded."
    )


def cannot_judge(c: Calibration) -> str:
    """Why chi-square can't judge the fit of the geometry; empty if it can."""
    if c.dof < 1.0:
        return "there are too few measurements"
    if c.noise_known:
        return ""
    if not c.noise.estimated.all():
        taken, others = (
            joined([what for what, e in zip(_measured_by(c), c.noise.estimated, strict=True) if e == estimated])
            for estimated in (True, False)
        )
        return (
            f"the noise of {taken} was taken from these residuals, that of {others} was declared: above 1, residuals are "
            "larger than the declared noise"
        )
    if np.isfinite(c.freedom):
        return "the noise was taken from these residuals, and outliers have full weight here"
    return "the noise was taken from these residuals, so that chi-square is 1 by construction"


def unseen_words(
    geometry: Geometry, directions: Floats, variance_reduction: Floats, remedies: Sequence[Remedy | None]
) -> tuple[str, ...]:
    """One sentence for each unobservable direction, in their order.

    ``directions``: (p, m) unit vectors in parameter space, in units of the tolerances. ``variance_reduction``: (m,) along
    each. ``remedies``: the measurement that would determine each; None where none is known.
    """
    sigma = np.sqrt(1.0 - variance_reduction).tolist()
    rows = zip(directions.T, sigma, remedies, strict=True)
    return tuple(f"{_sentence(geometry, *one)} {_remedy(remedy)}" for *one, remedy in rows)


def grouped(words: Sequence[str], remedies: Sequence[Remedy | None]) -> tuple[str, ...]:
    """The sentences of the directions that a usual measurement would show, and one sentence for all others; ``words``: as
    :func:`unseen_words` gives them."""
    useful = tuple(said for said, remedy in zip(words, remedies, strict=True) if remedy is not None)
    if (others := len(words) - len(useful)) < 2:
        return tuple(words)
    hardly = f"{others} other directions hardly move the platform at these poses"
    return (*useful, f"{hardly}: no usual measurement would determine them.")


def _remedy(remedy: Remedy | None) -> str:
    if remedy is None:
        return "No usual measurement at these poses would determine it: it hardly moves the platform there."
    return f"{remedy.count} {WHAT[remedy.what].format(axis=remedy.axis)} would determine it."


def _sentence(geometry: Geometry, direction: Floats, sigma: float) -> str:
    """A direction in words; ``sigma`` is its standard deviation in units of the tolerances."""
    order = np.argsort(-np.abs(direction))
    direction = direction * np.sign(direction[order[0]])
    sizes = direction * geometry.tolerance * sigma
    named = [f"{geometry.names[i]} by {_amount(sizes[i], geometry.parameters[i].unit)}" for i in order[:3]]
    listed = ", ".join(named)
    if _is_growth(geometry, direction):
        return f"The scale of the machine is not determined: all its lengths can change in proportion ({listed}, ...), 1 sigma."
    if abs(direction[order[0]]) > ALONG:
        return f"{named[0].replace(' by ', ' can be off by ')}, 1 sigma: these readings do not determine it."
    return f"Not determined separately: {listed}, ... (1 sigma): changed together, they hardly change these readings."


def _amount(value: float, unit: str) -> str:
    if unit == "m":
        return f"{1e3 * value:+.2g} mm"
    return f"{1e3 * value:+.2g} mrad" if unit == "rad" else f"{1e6 * value:+.2g} parts in a million"


def _is_growth(geometry: Geometry, direction: Floats) -> bool:
    """Whether in a direction all lengths grow in proportion to their nominal values."""
    growth = np.array([p.nominal if p.unit == "m" else 0.0 for p in geometry.parameters]) / geometry.tolerance
    norm = float(np.linalg.norm(growth))
    return norm > 0.0 and abs(float(direction @ growth)) / norm > ALONG
