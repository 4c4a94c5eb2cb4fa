"""Writing results: whole or not at all, never over what gtpin has not written itself, and finite numbers alone."""
