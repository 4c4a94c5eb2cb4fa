"""Virtual machines to try the package on: with errors of the geometry alone, or with effects as well."""

from gtpin.bench.simulator.build import measure_at
from gtpin.bench.simulator.case import draw_case, make_case, simulate_scenario
from gtpin.bench.simulator.instruments.build import build_measured, simulate_measured
from gtpin.bench.simulator.recipe import SimulatedConditions, SimulatedNoise, digest
from gtpin.bench.simulator.simulate import simulate
from gtpin.bench.simulator.truth import Case, EffectTruth, InstrumentCase, Simulation
from gtpin.errors import renamed_names

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

__getattr__ = renamed_names(
    __name__, {"Conditions": "SimulatedConditions", "Noise": "SimulatedNoise", "Truth": "EffectTruth"}
)
