"""Formats of files that tables leave in."""
