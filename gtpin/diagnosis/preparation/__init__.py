"""Covariates that cannot be right are left out before anything is inferred."""
