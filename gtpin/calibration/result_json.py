"""A calibration as JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from gtpin.typing import Floats

if TYPE_CHECKING:
    from gtpin.calibration.result import Calibration


def calibration_json(calibration: Calibration) -> dict[str, Any]:
    """The content of ``calibration.json``."""
    before, after = lengths(calibration.residual_before), lengths(calibration.residual)
    out, floor = (found or (None, None) for found in (calibration.left_out, calibration.floor))
    errors = {
        "position_rms_before": before[0],
        "position_rms_after": after[0],
        "position_rms_left_out": out[0],
        "position_noise_floor": floor[0],
        "orientation_rms_before": before[1],
        "orientation_rms_after": after[1],
        "orientation_rms_left_out": out[1],
        "orientation_noise_floor": floor[1],
    }
    noise = {
        "position_sigma": calibration.noise.position_sigma,
        "orientation_sigma": calibration.noise.orientation_sigma if calibration.residual.shape[1] == 6 else None,
        "repeatability": calibration.noise.repeatability,
        "lack": calibration.noise.lack,
        "range_ratio": calibration.noise.range_ratio if calibration.noise.sight is not None else None,
        "source": calibration.noise.source,
    }
    return fit_json(calibration, errors, noise)


def fit_json(calibration: Calibration, errors: dict[str, Any], noise: dict[str, Any]) -> dict[str, Any]:
    """The content of ``calibration.json`` with given errors and noise."""
    return {
        "schema": "gtpin-calibration/1",
        "model": "default" if calibration.paper_model is None else calibration.paper_model,
        "poses": calibration.poses,
        "rejected": list(calibration.rejected),
        **errors,
        "chi2_per_dof": calibration.chi2_per_dof,
        "iterations": calibration.iterations,
        "parameters": [
            {
                "name": p.name,
                "value": float(value),
                "sigma": float(sigma),
                "unit": p.unit,
                "nominal": p.nominal,
                "tolerance": p.tolerance,
                "learned": float(learned),
            }
            for p, value, sigma, learned in zip(
                calibration.model.geometry.parameters,
                calibration.values,
                calibration.sigma,
                calibration.learned,
                strict=True,
            )
        ],
        "unobservable": [{"direction": d.weights, "learned": d.learned} for d in calibration.unobservable],
        "equivalent_zeros": [
            {"site": z.site, "value": z.value, "sigma": z.sigma, "unit": z.unit} for z in calibration.zeros
        ],
        "correlations": [{"a": a, "b": b, "rho": rho} for a, b, rho in calibration.correlated()],
        "observability": calibration.observability.indices,
        "degrees_of_freedom": calibration.dof,
        "noise": {
            **noise,
            "tail_freedom": calibration.freedom if np.isfinite(calibration.freedom) else None,
            "enlarged": calibration.enlarged,
        },
        "warnings": list(calibration.warnings),
    }


def lengths(residual: Floats) -> tuple[float, float | None]:
    """Root mean square length of position (m) and rotation (rad) residuals."""
    position = float(np.sqrt((residual[:, :3] ** 2).sum(axis=1).mean()))
    if residual.shape[1] == 3:
        return position, None
    return position, float(np.sqrt((residual[:, 3:] ** 2).sum(axis=1).mean()))
