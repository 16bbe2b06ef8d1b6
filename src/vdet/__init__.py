"""Find and follow vehicles in road video on an ordinary CPU."""

__version__ = "0.1.0"
