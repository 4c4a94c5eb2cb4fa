"""Diagnosis: where the gap between simulation and reality lies, which effects cause it, and how much they explain."""
