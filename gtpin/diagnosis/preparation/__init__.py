"""Preparation of a dataset for a diagnosis: covariates that cannot be right are left out."""
