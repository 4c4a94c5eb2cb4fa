"""Correction tables for controllers and printer firmware: the sum of all errors over commands or positions."""
