"""What the command ``hmpim`` starts: it stands outside the package, whose import takes time.

Until the command line is there to answer it, Ctrl-C ends the process with 130 and no traceback.
"""

import os
import signal

__all__ = ["main"]

INTERRUPTED = 130


def main() -> None:
    """Import the command line and run it."""
    # Shells start background jobs with SIGINT ignored; that stays so.
    waits = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if waits:
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(INTERRUPTED))
    from hmpim.cli.main import main as command_line

    if waits:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    command_line()
