"""Causes of error of open chains."""
