"""The command line: parses, calls the library, prints. One small file a command."""

from vdet.cli.main import main

__all__ = ["main"]
