"""Labelled pictures: one module a format, and the checks that all share."""
