"""A certificate of accuracy: what the poses say of the machine (ISO 9283, ISO 230-2), and an uncertainty budget (GUM)."""
