"""Proposals of what to measure next."""
