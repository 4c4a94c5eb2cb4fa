"""Commands that bring the machine to wanted poses, using geometry and effects of a model."""

from gtpin.compensation.compensate import compensate, machine_of

__all__ = ["compensate", "machine_of"]
