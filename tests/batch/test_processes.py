"""Real processes: workers that die, and a command that is stopped."""

import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest

import hmpim
from batch_support import FS, rounded
from hmpim.batch import pool
from hmpim.batch.parts import parts_in
from hmpim.batch.run import Cluster


def test_a_worker_that_is_killed_loses_nothing(rows_file, tmp_path, monkeypatch):
    """It is killed once it has work; the one in its place does the rest.

    Workers are started anew, and import nothing of the script that asked for them: here one that
    ends every process that imports it, as multiprocessing's would.
    """
    out, script = tmp_path / "out", tmp_path / "script.py"
    script.write_text("raise SystemExit('imported')\n")
    monkeypatch.setitem(sys.modules, "__main__", SimpleNamespace(__file__=str(script)))
    crews = []
    begin = pool._Crew.__init__

    def kept(self, *arguments):
        begin(self, *arguments)
        crews.append(self)

    monkeypatch.setattr(pool._Crew, "__init__", kept)
    killed = []

    def kill(state):
        if 0 < state.records < 8 and not killed:
            victim = crews[0]._processes[0]
            os.kill(victim.pid, signal.SIGKILL)
            killed.append(victim.pid)

    table = hmpim.batch(
        rows_file, out=out, fs=FS, cluster=Cluster(workers=1, per_task=1), progress=kill
    )
    assert killed
    assert crews[0]._processes[0].pid != killed[0]
    assert rounded(table, "scale_factor") == {f"{rows_file}#unit{k}": float(k) for k in range(1, 9)}
    assert len(table) == len(parts_in(out)) == 8


@pytest.mark.study
def test_a_script_without_a_guard_runs(rows_file, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import hmpim\n"
        "from hmpim.batch.run import Cluster\n"
        f"table = hmpim.batch({str(rows_file)!r}, out={str(tmp_path / 'out')!r}, fs={FS},\n"
        "                    cluster=Cluster(workers=1))\n"
        "print(len(table))\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("8", "")
