"""The whitened linear problem: design matrix, evidence in closed form, scans of nonlinear parameters, cross-validation."""
