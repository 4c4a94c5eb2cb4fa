"""Identification of the geometry from measured poses: Gauss-Newton with priors, its result, observability."""
