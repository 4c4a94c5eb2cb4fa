"""Causes of error of open chains, and of machines whose loops are not rods."""
