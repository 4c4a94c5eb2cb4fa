"""Checks of a machine from a few poses: what has changed since a model was identified; plans of poses; a log of checks."""
