"""Presentations: text, table and figures of each kind of result, one file for each kind."""
