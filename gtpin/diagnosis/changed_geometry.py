"""Changes of the geometry itself since an earlier model, as a check names them: a link that was bent, set anew or exchanged.

In a diagnosis these are parameters of the geometry, which is fitted. A check holds the earlier geometry within its uncertainty,
so that they are hypotheses there; the model that it returns has them in its geometry, and not as effects.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gtpin.effects.displacement import Displacement, of_lengths, rods_of
from gtpin.effects.effect import Effect
from gtpin.effects.operating_points import OperatingPoints
from gtpin.model.model import Model
from gtpin.robot.chain import Chain

TYPICAL = 2e-4
"""Typical change of a length, m. Assumed: a fifth of a tolerance, as a turn of a fine thread or a slight bend makes."""


class LengthChange(Effect):
    """dL = l; dL is the change of a rod's length, m, the same at all poses since the earlier model.

    Parameters: ``length`` l, m, positive where the rod is longer than before.
    """

    id = "length_change"
    title = "changed length"
    clause = "{site} has another length than before"
    remedy = "Inspect the link and its joints: it was bent, set anew, exchanged, or has slipped; use the updated model."
    coefficient = ("length", "m")
    depends_on = ("direction",)
    since_a_model = True

    def __init__(self, model: Model) -> None:
        """For the rods whose lengths are parameters of a model."""
        names = {site: f"length[{site.removeprefix('link')}]" for site in model.robot.rod_sites}
        self.parameters_by_site = {site: name for site, name in names.items() if name in model.geometry.names}

    def sites(self, robot: Chain) -> tuple[str, ...]:
        """The rods whose lengths are parameters."""
        return tuple(self.parameters_by_site)

    def basis(self, at: OperatingPoints, site: str, shape_parameter: float | None = None) -> Displacement:
        """One length for all poses."""
        return of_lengths(at, rods_of(at, site), np.ones((len(at), 1, 1)), np.array([TYPICAL]))


def in_geometry(model: Model) -> Model:
    """The model with its changes of lengths as values of the geometry, with their part of the uncertainty."""
    names, joint, p = list(model.geometry.names), model.joint_covariance, len(model.geometry.names)
    if joint is None:
        return model
    moved, values, kept, place = np.eye(len(joint)), model.geometry.values.copy(), np.ones(len(joint), dtype=bool), p
    for active in model.effects:
        if isinstance(active.effect, LengthChange):
            index = names.index(active.effect.parameters_by_site[active.site])
            values[index] += active.coefficients[0]
            moved[index, place], kept[place] = 1.0, False
        place += len(active.coefficients)
    covariance = (moved @ joint @ moved.T)[np.ix_(kept, kept)]
    effects = tuple(active for active in model.effects if not isinstance(active.effect, LengthChange))
    return replace(
        model,
        geometry=model.geometry.with_values(values),
        effects=effects,
        covariance=covariance[:p, :p],
        joint_covariance=covariance if effects else None,
    )
