"""The error to expect of a machine that a file corrects: what the file can't hold, and what the data leave open."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gtpin.accuracy.expected import Undetermined, expected_rms, unexplained_error
from gtpin.compensation.machine import CompensatedMachine, machine_at
from gtpin.data.instrument_tables import PlaneTable
from gtpin.effects.operating_points import OperatingPoints
from gtpin.errors import ModelError
from gtpin.export.box import Box
from gtpin.export.loss import both_approaches, not_oriented, postures, ranges_known, rms, um
from gtpin.extras.certificate.held_against import ModelPosterior, at_commands, by_commands, by_unknowns, prior_sizes
from gtpin.extras.controllers.towers import DIMENSIONS, Drives, TowerFit
from gtpin.extras.importers.towers import Towers
from gtpin.model.model import Model
from gtpin.model.place import free_motions, without_place
from gtpin.typing import Floats, Mask

DRAWS = 2000
"""Number of machines that are drawn from the posterior for an interval."""
LEAST = 1e-8
"""Motion of the TCP, m, below which an effect counts as absent under the conditions of the tables."""
INTERVAL = (0.025, 0.975)
"""Quantiles of the intervals."""
WORSE = 1.05
"""Ratio of the error with tables to that without, from which tables make it worse. Assumed."""
UNITS = {"angle": ("deg", float(np.degrees(1.0))), "scale": ("per mille", 1e3)}
"""Units in messages, and factors to them, of those dimensions of a delta that are no lengths."""
DETERMINED = 0.5
"""Smallest share of a setting's prior variance that the data must take away, or the setting is left alone. Assumed: with less,
the setting would follow the tolerances more than the measurements."""


@dataclass(frozen=True, eq=False)
class OpenDirections:
    """What the data leave open of a machine: ``moved`` (N, 3, k) motions of the TCP, m, for k independent standard normal
    unknowns; ``unexplained``: one sigma, m, per axis, of errors that differ from pose to pose, and the ends of its 95 %
    interval; ``parts``: those of the motions, with where the machine stands, which ``moved`` has not if the instrument was
    free; None: not distinguished. ``noise_known``: False: noise of the instrument is among the unexplained errors."""

    moved: Floats
    unexplained: tuple[float, float, float] = (0.0, 0.0, 0.0)
    parts: Undetermined | None = None
    noise_known: bool = True

    def rms(self, residual: Floats, axes: slice = slice(0, 3)) -> tuple[float, float, float]:
        """Root mean square error of the machine, m, expected and the ends of a 95 % interval over the machines that the data
        allow; ``residual`` (N, 3): the error, m, of the machine that the model is.

        The half widths of the intervals of the two mean squares, of the motions and of the unexplained errors, are independent:
        their squares add up. Where the unexplained errors may be 0, the lower end is without them.
        """
        e, R = residual[:, axes], self.moved[:, axes]
        flat, n = R.reshape(-1, R.shape[2]), len(residual)
        square, cross = flat.T @ flat / n, flat.T @ e.ravel() / n
        fixed, (fresh, *ends) = float((e**2).sum() / n), (e.shape[1] * one**2 for one in self.unexplained)
        z = np.random.default_rng(0).standard_normal((DRAWS, len(square)))
        power = fixed + 2.0 * z @ cross + np.einsum("di,ij,dj->d", z, square, z, optimize=True)
        mean = fixed + float(np.trace(square))
        low, high = np.quantile(power, INTERVAL) - mean
        middle, half = mean + sum(ends) / 2.0, (ends[1] - ends[0]) / 2.0
        least = middle - np.hypot(low, half) if ends[0] else mean + low
        most = middle + np.hypot(high, half)
        expected = expected_rms(mean, fresh, noise_known=self.noise_known)
        return expected, float(np.sqrt(max(least, 0.0))), float(np.sqrt(most))

    @property
    def words(self) -> str:
        """The parts as text, um."""
        if self.parts is None:
            return f"{um(replace(self, unexplained=(0.0, 0.0, 0.0)).rms(np.zeros_like(self.moved[..., 0]))[0])} um"
        base, tool = self.parts.base, self.parts.tool
        named = [f"where the machine stands, {um(base)} um (not in this error)"] if base > LEAST else []
        named += [f"where the tool sits, {um(tool)} um"] if tool > LEAST else []
        rest = um(self.parts.rest)
        return f"{', '.join(named)}; everything else, {rest} um" if named else f"{rest} um"


def touches_one_plane(model: Model) -> bool:
    """Whether a model is of touches of one plane alone, which show no shift along it and no turn about its normal."""
    tables = [one.table for one in model.instruments]
    planes = [len(table.planes) for table in tables if isinstance(table, PlaneTable)]
    return len(planes) == len(tables) and sum(planes) == 1


def motions_of_no_error(model: Model) -> Floats:
    """(6, k) motions of the machine that are no error: those that no instrument shows, or where touches of one plane are all
    that was measured, the place of a print on its bed (shifts along x and y, and turns about z)."""
    return np.eye(6)[:, [0, 1, 5]] if touches_one_plane(model) else free_motions(model)


def open_directions(machine: CompensatedMachine, whole: Model, q: Floats) -> OpenDirections | None:
    """What the data leave open at commands q (N, n), without :func:`motions_of_no_error`, and what the model does not explain;
    None where the uncertainty of the geometry is not known. ``whole``: the model with its instruments.
    """
    if machine.model.covariance is None:
        return None
    at = _at(machine, q)
    moved = by_unknowns(machine.model, at) @ ModelPosterior(machine.model).root
    parts = None if touches_one_plane(whole) else Undetermined.of(whole, moved, at.poses)
    moved = without_place(moved[:, :3], at.poses.T, motions_of_no_error(whole))
    known = whole.unexplained is None or whole.unexplained.noise_known
    return OpenDirections(moved, unexplained_error(whole, by_commands(machine.model, at)), parts, known)


def left_of_commands(model: Model, q: Floats, where: str) -> tuple[str, ...]:
    """What corrected commands (N, n) leave of the machine's error, as texts; none where it is not known. ``where``: at what
    poses. And whether the data do not determine orientations."""
    doubt = open_directions(machine_at(model)[0], model, q)
    if doubt is None:
        return ()
    words = machine_words(doubt, np.zeros((len(q), 3)), None, where, standing=touches_one_plane(model))
    return (f"leaves {words}", *not_oriented(model))


def left_of_drives(model: Model, carried: Collection[str], session: str | None) -> tuple[str, ...]:
    """The same of tables for each actuator, which hold the effects of the names ``carried``."""
    machine = machine_at(model, session)[0]
    q, poses = postures(machine.model)
    doubt = open_directions(machine, model, q)
    if doubt is None:
        return ()
    after = replace(machine, model=machine.model.without(carried)).goes_to(q, both_approaches(len(q))) - poses.T
    after = without_place(after, poses.T, motions_of_no_error(model))
    over = "the ranges of the fit" if ranges_known(machine.model) else "the whole ranges of the drives"
    warm = [one.references.temperature for one in machine.model.effects if machine.temperature_columns]
    where = f"{over}{f' at {warm[0]:g} degC' if warm else ''}, with the calibrated kinematics in the controller"
    return (f"leaves {machine_words(doubt, after, None, where, standing=touches_one_plane(model))}",)


def determined(machine: CompensatedMachine, q: Floats, settings: Callable[[Floats], list[Floats]]) -> Mask:
    """Whether the data determine settings that follow from the errors of the TCP at commands q (N, n).

    ``settings``: for errors (N, 3, k) of the TCP, m, the changes of each setting, (..., k): of several numbers together their
    variances count.
    """
    if machine.model.covariance is None:
        return np.ones(len(settings(np.zeros((len(q), 3, 1)))), dtype=bool)
    at = _at(machine, q)
    D = by_unknowns(machine.model, at)[:, :3]
    before, after = settings(D * prior_sizes(machine.model, at)), settings(D @ ModelPosterior(machine.model).root)
    power = np.array([[float((part**2).sum()) for part in parts] for parts in (before, after)])
    return np.asarray(power[1] <= (1.0 - DETERMINED) * power[0])


def changed_dimensions(
    machine: CompensatedMachine, drives: Drives, towers: Towers, free: Mask, box: Box
) -> tuple[str, ...]:
    """A message on the changes of those dimensions of a delta that are ``free``, each with 1 sigma where it is known.

    ``drives``: with the present dimensions. ``towers``: the new ones.
    """
    fit, sigma = TowerFit.of(machine, drives, box), None
    if machine.model.covariance is not None:
        moved = by_unknowns(machine.model, _at(machine, fit.needed))[:, :3] @ ModelPosterior(machine.model).root
        gain = fit.response(free)[1]
        sigma = np.linalg.norm(gain @ moved.reshape(gain.shape[1], -1), axis=1)
    words, change = [], towers.values - drives.towers.values
    for k in np.flatnonzero(free):
        unit, factor = UNITS.get(DIMENSIONS[k].split()[0], ("mm", 1e3))
        doubt = "" if sigma is None else f" +- {factor * sigma[k]:.2g}"
        words.append(f"{DIMENSIONS[k]} by {factor * change[k]:+.3f}{doubt} {unit}")
    return (f"changes {', '.join(words)}{'' if sigma is None else ' (1 sigma)'}",) if words else ()


def _at(machine: CompensatedMachine, q: Floats) -> OperatingPoints:
    return at_commands(machine.model, q, machine.columns(len(q)))


@dataclass(frozen=True, eq=False)
class Left:
    """(N, 3) errors of the TCP without and with tables, base frame, m, and what the data leave open there; None: not known."""

    before: Floats
    after: Floats
    doubt: OpenDirections | None = None
    standing: bool = False
    """Whether a shift and a turn on the bed is no error."""

    def size(self, xyz: Floats) -> str:
        """Text with the relative errors of lengths in x and in y, per cent, at points xyz (N, 3), m."""
        xy = xyz[:, :2] - xyz[:, :2].mean(axis=0)

        def scale(errors: Floats) -> Floats:
            return np.asarray(
                100.0
                * np.einsum("nk,nk...->k...", xy, errors[:, :2])
                / (xy**2).sum(axis=0).reshape(2, *[1] * (errors.ndim - 2))
            )

        open_ = [""] * 2
        if self.doubt is not None:
            open_ = [f"1 sigma {sigma:.2g} %; " for sigma in np.linalg.norm(scale(self.doubt.moved), axis=1)]
        found = [
            f"in {axis} off by {after:+.2f} % ({sigma}before {before:+.2f} %)"
            for axis, after, sigma, before in zip("xy", scale(self.after), open_, scale(self.before), strict=True)
        ]
        return f"leaves lengths of parts {' and '.join(found)}"

    @property
    def expected(self) -> float:
        """Root mean square error with tables, m: of the machine where its uncertainty is known, else of the model."""
        return rms(self.after) if self.doubt is None else self.doubt.rms(self.after)[0]

    @property
    def is_nothing(self) -> bool:
        """Whether there is no error to correct."""
        return rms(self.before) < LEAST

    @property
    def is_worse(self) -> bool:
        """Whether the error is larger with the tables; that of backlash is the same."""
        return rms(self.after) > WORSE * rms(self.before) > LEAST

    def words(self, where: str, temperatures: Mapping[str, float]) -> str:
        """Text with the root mean squares of both errors, um: of the machine where its uncertainty is known, else of the
        model."""
        where += "".join(f", {name} {value:g} degC" for name, value in temperatures.items())
        if self.doubt is None:
            return (
                f"leaves {um(rms(self.after))} of {um(rms(self.before))} um of the TCP's error in {where}"
                f" (z: {um(rms(self.after[:, 2:]))} of {um(rms(self.before[:, 2:]))} um)"
            )
        return f"leaves {machine_words(self.doubt, self.after, self.before, where, standing=self.standing)}"


def machine_words(
    doubt: OpenDirections, after: Floats, before: Floats | None, where: str, *, standing: bool = False
) -> str:
    """The expected error of a machine, um, with the parts of the file and of the data, from (N, 3) errors of its model, m.

    ``before``: the errors without the file; None where they are not known.
    """
    found, low, high = map(um, doubt.rms(after))
    of = "" if before is None else f" of {um(doubt.rms(before)[0])}"
    up = f"z: {um(doubt.rms(after, slice(2, 3))[0])}"
    up += "" if before is None else f" of {um(doubt.rms(before, slice(2, 3))[0])}"
    up += " um; a shift or turn of the part on the bed is no error" if standing else " um"
    lost = rms(after)
    if doubt.unexplained[0] > LEAST:
        noise = "" if doubt.noise_known else " (noise of the instrument is in it, because it is not known)"
        left = (
            f"Not explained by the model, of the data of its fit: {um(np.sqrt(3.0) * doubt.unexplained[0])} um{noise}. "
        )
    else:
        left = ""
    held = "The file holds the model exactly." if lost < LEAST else f"The file can't hold {um(lost)} um of the model."
    alike = "It is taken as equal along x, y and z, and can be larger where conditions differ from those of the fit. "
    return (
        f"an expected error of the machine's TCP of {found}{of} um in {where} (95 %: {low} to {high} um; {up}). {held} "
        f"{left}{alike if left and doubt.noise_known else ''}Not determined by the data: {doubt.words}"
    )


def check_any(left: Sequence[Left]) -> None:
    """Raise `ModelError` if there is no error to correct at any temperature."""
    if all(some.is_nothing for some in left):
        hint = "give a calibrated or diagnosed model, and --temperature for effects of temperatures"
        raise ModelError("there is nothing to correct: the model is what the controller has", hint=hint)


def by_parts(parts: Mapping[str, Left]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The remaining error of each part of the model if tables are made for it alone, as texts, and the names of effects that
    move nothing under the conditions of the tables."""
    words, absent = [], []
    if len(parts) < 2:  # its part is the whole
        return (), ()
    for name, found in parts.items():
        if not found.is_nothing:
            words.append(f"{name} {um(rms(found.after))} of {um(rms(found.before))} um")
        elif name != "geometry":
            absent.append(name)
    return ((f"leaves of each part alone: {', '.join(words)}",) if words else ()), tuple(absent)
