"""Causes of error of open chains, and of machines with loops that are no rods."""
