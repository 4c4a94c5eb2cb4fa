"""Blind checks: machines with sealed effects are diagnosed, the seals opened, and the diagnoses scored."""
