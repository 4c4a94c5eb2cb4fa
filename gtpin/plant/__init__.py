"""A virtual machine to try the package on: its geometry is known, its measurements are noisy."""
