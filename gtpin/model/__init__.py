"""The calibrated model, its files, and its predictions."""
