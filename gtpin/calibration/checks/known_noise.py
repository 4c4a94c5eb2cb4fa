"""The noise of measured poses; data for which it is neither declared nor known from a model are refused."""

from __future__ import annotations

from gtpin.data import Dataset
from gtpin.errors import DatasetError
from gtpin.noise.noise import Noise


def known_noise(dataset: Dataset, position: float | None, orientation: float | None, repeatability: float) -> Noise:
    """The noise of measured poses from declared sigmas, or from those of a model.

    ``position``, ``orientation``: the instrument's standard deviations per axis, m and rad; None where neither the data nor
    a model states them. Orientation may be None where only positions were measured. ``repeatability``: repeatability of the
    actuators, m or rad.

    Raises `DatasetError` if a sigma that the data need is not known.
    """
    if position is None or (orientation is None and dataset.orientation is not None):
        raise DatasetError(
            "the noise is not known: neither these data nor the model state it",
            file=dataset.file,
            column="instrument.position_sigma" if position is None else "instrument.orientation_sigma",
            hint="declare position_sigma and orientation_sigma under [instrument], or calibrate the model again",
        )
    return Noise(position, 1.0 if orientation is None else orientation, repeatability)
