"""A certificate of accuracy: pose accuracy and repeatability (ISO 9283, ISO 230-2), and an uncertainty budget (GUM)."""
