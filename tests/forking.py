"""Runs as processes of their own that begin at once: forked from one that has all it needs.

As a program it reads one run a line (JSON: folder, arguments of `hmpim`, or source and its
arguments), forks it, and writes what it ended with into `code.txt` in the run's folder.
"""

import json
import os
import select
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

PATIENCE = 300.0
"""Seconds after which something counts as hung, on a machine however busy."""


class Nursery:
    """The process that forks the runs."""

    def __init__(self):
        self.process = subprocess.Popen([sys.executable, __file__], stdin=subprocess.PIPE)

    def begin(self, folder, *arguments, source=None):
        order = {"folder": str(folder), "arguments": arguments, "source": source}
        self.process.stdin.write(json.dumps(order).encode() + b"\n")
        self.process.stdin.flush()
        return Forked(folder)

    def close(self):
        self.process.stdin.close()
        assert self.process.wait(PATIENCE) == 0


class Forked:
    """One run, as far as `subprocess.Popen` is needed."""

    def __init__(self, folder):
        self.folder, self.stderr = Path(folder), None
        while not (self.folder / "pid.txt").exists():
            time.sleep(0.002)
        self.pid = int((self.folder / "pid.txt").read_text())

    @property
    def returncode(self):
        code = self.folder / "code.txt"
        return int(code.read_text()) if code.exists() else None

    def poll(self):
        return self.returncode

    def communicate(self, timeout):
        deadline = time.monotonic() + timeout
        while self.poll() is None:
            assert time.monotonic() < deadline, "it did not end"
            time.sleep(0.005)
        return None, (self.folder / "said.txt").read_text()

    def kill(self):
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)

    def wait(self):
        self.communicate(PATIENCE)


def written(path, text):
    """Never seen half written."""
    beside = path.with_suffix(".new")
    beside.write_text(text)
    beside.replace(path)


def run_here(order):
    """In the forked process; does not return."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.chdir(order["folder"])
    said = os.open("said.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    os.dup2(said, 2)
    written(Path("pid.txt"), str(os.getpid()))
    code = 0
    try:
        if order["source"] is not None:
            sys.argv = ["-c", *order["arguments"]]
            exec(compile(order["source"], "-c", "exec"), {"__name__": "__main__"})
        else:
            from hmpim.cli.main import main

            sys.argv = ["hmpim", *order["arguments"]]
            main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        code = 1
    sys.stderr.flush()
    os._exit(code)


def serve():
    import hmpim.cli.main
    import hmpim.experiment
    import hmpim.formats.recording
    import hmpim.formats.stimulus_files
    import hmpim.rigs.catalogue
    import hmpim.rigs.wire  # noqa: F401

    running, whole = {}, b""
    while True:
        if select.select([0], [], [], 0.01)[0]:
            read = os.read(0, 65_536)
            if not read:
                break
            *lines, whole = (whole + read).split(b"\n")
            for order in map(json.loads, lines):
                pid = os.fork()
                if pid == 0:
                    run_here(order)
                running[pid] = Path(order["folder"])
        while running:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if pid == 0:
                break
            written(running.pop(pid) / "code.txt", str(os.waitstatus_to_exitcode(status)))
    for pid in running:
        os.kill(pid, signal.SIGKILL)


if __name__ == "__main__":
    serve()
