"""What is asked of data before, while and after a geometry is fitted to them: mistakes are named, not fitted."""
