"""Real processes: workers that die, and a command that is stopped."""

import json
import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import hmpim
from batch_support import FS, gain_record, rounded
from hmpim.batch import Request, pool
from hmpim.batch.parts import parts_in
from hmpim.batch.run import Cluster


def _keep_crews(patch, crews):
    """Have the workers' crews in a list as well, to find whom to kill."""
    begin = pool._Crew.__init__

    def kept(self, *arguments):
        begin(self, *arguments)
        crews.append(self)

    patch.setattr(pool._Crew, "__init__", kept)


def listening(pid: int) -> set[str]:
    """Addresses at which a process is there for others."""
    import psutil

    found = psutil.Process(pid).net_connections(kind="inet")
    return {one.laddr.ip for one in found if one.status == psutil.CONN_LISTEN}


def test_a_worker_that_is_killed_loses_nothing(rows_file, tmp_path, monkeypatch):
    """It is killed once it has work; the one in its place does the rest.

    Workers are started anew, and import nothing of the script that asked for them: here one that
    ends every process that imports it, as multiprocessing's would.
    """
    out, script = tmp_path / "out", tmp_path / "script.py"
    script.write_text("raise SystemExit('imported')\n")
    monkeypatch.setitem(sys.modules, "__main__", SimpleNamespace(__file__=str(script)))
    crews, killed, heard = [], [], set()
    _keep_crews(monkeypatch, crews)

    def kill(state):
        if 0 < state.records < 8 and not killed:
            victim = crews[0]._processes[0]
            heard.update(listening(victim.pid), listening(os.getpid()))
            os.kill(victim.pid, signal.SIGKILL)
            killed.append(victim.pid)

    table = hmpim.batch(
        rows_file, out=out, fs=FS, cluster=Cluster(workers=1, per_task=1), progress=kill
    )
    assert killed
    assert heard == {"127.0.0.1"}  # Dask's own HTTP servers among them
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


FULL_AND_FREE = """
import json, pathlib, subprocess
from hmpim.batch import open_table

def mount(*options):
    subprocess.run(["mount", *options, out], check=True)

def run():
    done = subprocess.run(command, capture_output=True, text=True)
    parts = pathlib.Path(out, "parts").glob("*.parquet")
    return done.returncode, done.stderr, {p.name: p.stat().st_mtime_ns for p in parts}

mount("-t", "tmpfs", "-o", "size=160k", "none")
full = run()
half = [p.name for p in pathlib.Path(out, "parts").glob(".hmpim-*")]
mount("-o", "remount,size=64m")
free = run()
table = open_table(out).to_pandas(["record", "reason"])
rows = [sorted(table["record"]), int(table["reason"].notna().sum())]
print(json.dumps([full, half, free, rows]))
"""


@pytest.mark.study
def test_a_disk_that_is_full_and_then_is_not(rows_file, tmp_path):
    """A file system of 160 kB, in a name space of its own: half the parts fit."""
    out = tmp_path / "disk"
    out.mkdir()
    command = [sys.executable, "-m", "hmpim.cli.main", "batch", str(rows_file), "--fs", str(FS)]
    command += ["--out", str(out), "--workers", "2", "--per-task", "1"]
    script = tmp_path / "script.py"
    script.write_text(f"out, command = {str(out)!r}, {command!r}\n{FULL_AND_FREE}")
    apart = ["unshare", "--user", "--map-root-user", "--mount"]
    try:
        allowed = subprocess.run([*apart, "true"], capture_output=True).returncode == 0
    except FileNotFoundError:
        allowed = False
    if not allowed:
        pytest.skip("this system allows no mount name space of one's own (unshare)")
    told = subprocess.run([*apart, sys.executable, str(script)], capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    (code, said, before), half, (again, silent, after), (names, failures) = json.loads(told.stdout)
    assert (code, half) == (2, [])
    assert "No space left" in said
    assert said.count("\n") == 1
    assert 0 < len(before) < 8
    assert (again, silent, len(after)) == (0, "", 8)
    assert before.items() <= after.items()  # kept, and not written again
    assert (names, failures) == ([f"{rows_file}#unit{k}" for k in range(1, 9)], 0)


@pytest.mark.study
def test_damage_among_thousands(tmp_path):
    """Two thousand records; one with a gap, a file cut short, one of nonsense; a worker killed."""
    import pyarrow as pa
    from pyarrow import parquet

    rng, place = np.random.default_rng(0), tmp_path / "records"
    place.mkdir()
    u, y = (channel.values for channel in gain_record(1).channels)
    many = [y * (1 + 0.01 * rng.standard_normal()) for _ in range(2000)]
    many = [values + 0.01 * rng.standard_normal(values.size) for values in many]
    many[777][50] = np.nan
    cells = {"u": [u.tolist()] * 2000, "y": [values.tolist() for values in many]}
    parquet.write_table(pa.table(cells), place / "fleet.parquet", row_group_size=100)
    whole = (place / "fleet.parquet").read_bytes()
    (place / "short.parquet").write_bytes(whole[: len(whole) // 2])
    (place / "nonsense.csv").write_text("time,u,y\n0,1,2\n1,nonsense,\n")
    crews, killed = [], []

    def kill(state):
        if state.records > 600 and not killed:
            crews[0]._processes[0].kill()
            killed.append(state.records)

    with pytest.MonkeyPatch.context() as patch:
        _keep_crews(patch, crews)
        table = hmpim.batch(
            place,
            out=tmp_path / "out",
            fs=FS,
            request=Request(keep="parameters"),
            cluster=Cluster(workers=2),
            progress=kill,
        )
    assert killed
    frame = table.to_pandas(["record", "reason"])
    assert len(frame) == frame["record"].nunique() == 2002
    failed = frame[frame["reason"].notna()]["record"]
    assert {name.rpartition("/")[2] for name in failed} == {"short.parquet", "nonsense.csv"}
