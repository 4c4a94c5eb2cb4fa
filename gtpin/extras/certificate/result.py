"""The result of a certification."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from gtpin.data import Dataset
from gtpin.diagnosis.result import Verdict
from gtpin.extras.certificate.budget import Budget
from gtpin.extras.certificate.quantity import Quantity
from gtpin.model.model import Model
from gtpin.model.place import free_motions
from gtpin.noise.noise import Noise
from gtpin.output.shown import SavedResult, present

Basis = Literal["left_out", "new", "fitted"]
"""The poses of the errors of the corrected machine: left out of the fit in turn, new to the given model, or those to which the
given model was fitted."""


@dataclass(frozen=True, repr=False)
class Certificate(SavedResult):
    """Accuracy of a machine and uncertainty of its corrected positions; see ``docs/health.md``.

    Parameters
    ----------
    model
        Model of the corrected machine, whose controller inverts it to compute the commands.
    quantities
        Pose accuracy and repeatability (ISO 9283), positioning of each actuator (ISO 230-2).
    budget
        The uncertainty budget (GUM).
    noise
        Noise of the instrument.
    basis
        The poses of the errors of the corrected machine. ``left_out``: poses that were left out of the fit in turn.
        ``new``: poses that the given model was not fitted to. ``fitted``: poses that the given model was fitted to.
    one_way
        Whether a repeatability compares only visits with the same directions of approach.
    noise_known
        The source of the noise of a visit. ``declared``: dataset.toml. ``visits``: repeated visits. ``no``: residuals only.
        These also contain errors that the model does not explain, so all residuals then count as unexplained.
    verdict
        Verdict of the diagnosis that made the model; None where the model was given.
    poses, rows
        Number of different poses, and number of rows, that were used.
    set_aside
        Ids of poses with rows that were set aside.
    dataset, seed
        The data, and the seed of the random draws.
    warnings
        Texts of all warnings, also of those when the dataset was read.

    Examples
    --------
    >>> import gtpin
    >>> dataset = gtpin.Dataset.read("measured")
    >>> certificate = gtpin.certify(dataset, gtpin.calibrate(dataset).model)
    >>> certificate["RP_l"].missing
    'few_cycles'
    >>> bool((certificate.budget.largest[:3] > 0.0).all())
    True
    """

    model: Model
    quantities: tuple[Quantity, ...]
    budget: Budget
    noise: Noise
    basis: Basis
    one_way: bool
    noise_known: Literal["declared", "visits", "no"]
    verdict: Verdict | None
    poses: int
    rows: int
    set_aside: tuple[str, ...]
    dataset: Dataset
    seed: int = 0
    warnings: tuple[str, ...] = ()

    @property
    def point(self) -> Literal["tcp", "target"]:
        """What is certified: the TCP, or the measured target where its place on the tool was unknown."""
        return "target" if self.model.free_target else "tcp"

    @property
    def stands(self) -> Literal["measured", "fitted"]:
        """Where the machine stands: ``measured`` in the base frame, or ``fitted`` to the poses, which then do not show it."""
        return "fitted" if free_motions(self.model).size else "measured"

    def __getitem__(self, name: str) -> Quantity:
        """One quantity by its symbol (``AP_p``), for an actuator with its site (``B[cart1]``). Raises `KeyError` if there is
        none."""
        symbol, _, site = name.partition("[")
        found = [one for one in self.quantities if (one.symbol, one.site) == (symbol, site.rstrip("]"))]
        if not found:
            raise KeyError(name)
        return found[0]

    def to_json(self) -> dict[str, Any]:
        """The content of ``certificate.json``."""
        content: dict[str, Any] = present(self).json()
        return content
