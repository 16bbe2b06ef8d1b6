"""Boxes and labels, drawn into BGR images."""
