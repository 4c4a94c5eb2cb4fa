"""Commands that bring the machine, with all that a model knows of it, to where it was wanted."""

from gtpin.compensation.compensate import compensate, machine_of
from gtpin.compensation.corrections import Correction, corrections

__all__ = ["Correction", "compensate", "corrections", "machine_of"]
