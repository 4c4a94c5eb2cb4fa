"""A diagnosed machine in any simulator of its nominal robot: commands for it, and the offset of the TCP that remains."""

from gtpin.extras.simulators.any_simulator import Diagnosed, SimulatorCommands, commands_for_simulator

__all__ = ["Diagnosed", "SimulatorCommands", "commands_for_simulator"]
