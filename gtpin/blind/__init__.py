"""Blind checks: machines with sealed effects are diagnosed, the seals opened, and a score told."""
