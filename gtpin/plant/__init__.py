"""Virtual machines to try the package on: with errors of the geometry alone, or with effects as well."""

from gtpin.plant.bulk import draw_case
from gtpin.plant.case import make_case
from gtpin.plant.digest import digest
from gtpin.plant.instruments.build import build_measured
from gtpin.plant.instruments.case import InstrumentCase
from gtpin.plant.instruments.plain import simulate_measured
from gtpin.plant.later import measure_at
from gtpin.plant.scenario import simulate_scenario
from gtpin.plant.simulate import Simulation, simulate
from gtpin.plant.truth import Case, Truth

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
