"""A diagnosed machine in any simulator of its nominal robot: commands for it, and the offset of the TCP that remains."""

from gtpin.sim.simulator_commands import SimulatorCommands, commands_for_simulator
from gtpin.sim.wrapper import Diagnosed

__all__ = ["Diagnosed", "SimulatorCommands", "commands_for_simulator"]
