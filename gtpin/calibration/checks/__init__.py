"""Checks of the data before, during and after the fit of a geometry: mistakes are reported, not fitted."""
