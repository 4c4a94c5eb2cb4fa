"""A virtual machine to try the package on: its geometry is known, its measurements are noisy."""

from gtpin.plant.simulate import Simulation, simulate

__all__ = ["Simulation", "simulate"]
