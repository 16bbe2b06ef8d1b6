"""The command line, one file for each command: it parses, calls the library and prints."""

from vdet.cli.command import main

__all__ = ["main"]
