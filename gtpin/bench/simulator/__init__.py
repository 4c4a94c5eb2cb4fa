"""Virtual machines to try the package on: with errors of the geometry alone, or with effects as well."""

from gtpin.bench.simulator.bulk import draw_case
from gtpin.bench.simulator.case import make_case
from gtpin.bench.simulator.digest import digest
from gtpin.bench.simulator.instruments.build import build_measured
from gtpin.bench.simulator.instruments.case import InstrumentCase
from gtpin.bench.simulator.instruments.plain import simulate_measured
from gtpin.bench.simulator.later import measure_at
from gtpin.bench.simulator.scenario import simulate_scenario
from gtpin.bench.simulator.simulate import Simulation, simulate
from gtpin.bench.simulator.truth import Case, Truth

__all__ = [
    "Case",
    "InstrumentCase",
    "Simulation",
    "Truth",
    "build_measured",
    "digest",
    "draw_case",
    "make_case",
    "measure_at",
    "simulate",
    "simulate_measured",
    "simulate_scenario",
]
