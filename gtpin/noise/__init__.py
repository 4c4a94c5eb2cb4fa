"""The noise of measured poses, by one likelihood: from repeated visits, from residuals, with heavy tails."""
