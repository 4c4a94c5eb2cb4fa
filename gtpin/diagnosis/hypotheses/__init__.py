"""What may explain a gap: effects at sites, smooth nonparametric terms, proxies for missing covariates."""
