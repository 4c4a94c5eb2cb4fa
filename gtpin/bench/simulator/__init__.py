"""Virtual machines to try the package on: with errors of the geometry alone, or with effects as well."""

from gtpin.bench.simulator.build import measure_at
from gtpin.bench.simulator.case import draw_case, make_case, simulate_scenario
from gtpin.bench.simulator.instruments.build import build_measured, simulate_measured
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise, digest
from gtpin.bench.simulator.simulate import Simulation, simulate
from gtpin.bench.simulator.truth import Case, EffectTruth, InstrumentCase
from gtpin.errors import warn

__all__ = [
    "Case",
    "EffectTruth",
    "InstrumentCase",
    "SimulatedConditions",
    "SimulatedNoise",
    "Simulation",
    "build_measured",
    "digest",
    "draw_case",
    "make_case",
    "measure_at",
    "simulate",
    "simulate_measured",
    "simulate_scenario",
]

_OLD = {"Conditions": SimulatedConditions, "Noise": SimulatedNoise, "Truth": EffectTruth}
"""Names until 0.4."""


def __getattr__(name: str) -> object:
    if name not in _OLD:
        raise AttributeError(f"module 'gtpin.bench.simulator' has no attribute {name!r}")
    warn(f"{name} is now called {_OLD[name].__name__}; the old name goes with version 0.4", DeprecationWarning)
    return _OLD[name]
