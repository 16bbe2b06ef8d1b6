"""Reasons to doubt a result: typed findings about a video."""
