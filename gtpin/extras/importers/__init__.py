"""Readers of files from other programs, one module for each format; their results can be written as a dataset folder.

`docs/importers.md` describes each format, with its source.
"""
