"""A diagnosed machine in any simulator that has its nominal model: commands, and what commands can't show."""

from gtpin.sim.simulator_commands import SimulatorCommands, commands_for_simulator
from gtpin.sim.wrapper import Diagnosed

__all__ = ["Diagnosed", "SimulatorCommands", "commands_for_simulator"]
