"""Models 1 to 5 of Dressler et al. 2010 side by side on poses that were not fitted: the command ``compare``."""
