"""The command line, one file for each command: it parses, calls the library and prints."""

from vdet.cli.main import main

__all__ = ["main"]
