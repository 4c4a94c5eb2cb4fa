"""A calibrated model, its file and folder, and what it predicts."""
