"""Log records as lines on standard error that do not tear progress bars."""

import logging

from vdet.cli.progress import tell


class _Lines(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        kind = "" if record.levelno < logging.WARNING else f"{record.levelname.lower()}: "
        tell(f"vdet: {kind}{record.getMessage()}")


def set_up_logs(*, verbose: bool, quiet: bool) -> None:
    """Send the library's records to standard error: warnings, with `verbose` all, else errors."""
    log = logging.getLogger("vdet")
    log.handlers = [_Lines()]
    log.propagate = False
    log.setLevel(logging.ERROR if quiet else logging.DEBUG if verbose else logging.WARNING)
