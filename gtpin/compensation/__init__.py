"""Commands that bring the machine to wanted poses, using geometry and effects of a model."""

from gtpin.compensation.compensate import compensate, machine_of
from gtpin.compensation.corrections import Correction, corrections

__all__ = ["Correction", "compensate", "corrections", "machine_of"]
