"""Labelled pictures: read from the usual forms, searched and scored."""
