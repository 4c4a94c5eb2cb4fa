"""Results as text, JSON, figures and HTML pages."""
