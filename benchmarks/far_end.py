"""`hmpim table --udp` in a process of its own, in real time."""

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def far_end(*options: str) -> Iterator[tuple[str, int]]:
    """Serve at a free port until the block ends; yields host and port."""
    words = ["table", "--udp", "127.0.0.1:0", *options]
    command = [sys.executable, "-m", "hmpim.cli.main", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            found = re.search(r"udp://([\d.]+):(\d+)", process.stdout.readline())
            assert found is not None
            yield found[1], int(found[2])
        finally:
            process.terminate()
