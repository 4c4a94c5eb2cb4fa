"""Writing results: completely or not at all, never over files that gtpin has not written itself, with finite numbers only."""
