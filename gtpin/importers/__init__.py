"""Readers of files that other programs write, each for one format; they give what a dataset folder is written from.

`docs/importers.md` describes each format, with its source.
"""
