"""The hypothesis set of a diagnosis: effects at sites, smooth nonparametric terms, proxies for missing covariates."""
