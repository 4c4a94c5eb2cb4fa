"""From evidence to a verdict: search, classes, verdict, joint fit, noise."""
