"""A certificate as the content of ``certificate.json``."""

from __future__ import annotations

from typing import Any

from gtpin.certificate.budget import COVERAGE
from gtpin.certificate.quantity import Quantity
from gtpin.certificate.result import Certificate
from gtpin.model.model_folder import model_json
from gtpin.report.certificate_definitions import DEFINITIONS, SOURCES
from gtpin.report.certificate_words import BASES, HOW, limits, statement, why
from gtpin.report.provenance import digest

AXES = ("x", "y", "z", "rx", "ry", "rz")
MODEL = "model/model.json"
"""The certified model, beside the certificate."""


def row_of(q: Quantity) -> dict[str, Any]:
    """A number of a certificate: value, standard uncertainty, unit, numbers of poses and rows, and why it is blank."""
    return {
        "symbol": q.symbol,
        "site": q.site,
        "value": q.value,
        "sigma": q.sigma,
        "unit": q.unit,
        "poses": q.poses,
        "rows": q.rows,
        "reason": why(q),
    }


def certificate_json(c: Certificate) -> dict[str, Any]:
    """The content of ``certificate.json``, in SI units. Where the data do not suffice, a value is None and has a ``reason``."""
    b, count = c.budget, 6 if c.budget.orientation else 3
    return {
        "schema": "gtpin-certificate/1",
        "robot": c.model.robot.name,
        "poses": c.poses,
        "rows": c.rows,
        "set_aside": list(c.set_aside),
        "basis": c.basis,
        "basis_words": BASES[c.basis],
        "verdict": c.verdict,
        "effects": [active.name for active in c.model.effects],
        "model": {"file": MODEL, "sha256": digest(model_json(c.model).encode())},
        "noise": {
            "position_sigma": c.noise.position_sigma,
            "orientation_sigma": c.noise.orientation_sigma if count == 6 else None,
            "known": c.noise_known,
        },
        "statement": statement(c),
        "commands": limits(c),
        "quantities": [
            row_of(q)
            | {
                "formula": DEFINITIONS[q.symbol].formula,
                "standard": DEFINITIONS[q.symbol].standard,
                "estimate": DEFINITIONS[q.symbol].estimate,
            }
            for q in c.quantities
        ],
        "budget": {
            "poses": len(b.q),
            "contributions": [
                {
                    "source": row.source,
                    "type": row.kind,
                    "input": row.input,
                    "unit": row.unit,
                    "sensitivity": row.sensitivity,
                    "standard_uncertainty": row.position,
                    "share": b.share(row),
                    "reason": why(row),
                    "method": HOW[row.source],
                }
                for row in b.rows
            ],
            "directions": [
                {"changes": {name: change for name, change, _ in d.changes}, "standard_uncertainty": d.position}
                for d in b.directions
            ],
            "combined": dict(zip(AXES[:count], b.combined.tolist(), strict=False)),
            "coverage_factor": COVERAGE,
            "expanded": dict(zip(AXES[:count], (COVERAGE * b.combined).tolist(), strict=False)),
            "largest": dict(zip(AXES[:count], b.largest.tolist(), strict=False)),
            "radius": b.radius,
        },
        "sources": list(SOURCES),
        "seed": c.seed,
    }
