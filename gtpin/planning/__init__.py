"""Plans of poses to measure: for a calibration, to distinguish effects, to see whether a machine has changed."""
