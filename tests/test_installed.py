"""Installed, not only cloned: the wheel holds what the code opens, and runs away from the clone."""

import ast
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests_support import printed_by

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"
POSIX_ONLY = ("resource", "fcntl", "termios", "pty", "tty", "pwd", "grp", "syslog")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    pytest.importorskip("hatchling")
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=900)
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def unpacked(wheel, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(folder)
    return folder


def python(unpacked, *arguments, cwd):
    """Run with the wheel's files, and nothing of the clone on the path."""
    environment = {**os.environ, "PYTHONPATH": str(unpacked), "MPLBACKEND": "Agg"}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )


def test_the_wheel_holds_every_file_of_the_package(wheel):
    with zipfile.ZipFile(wheel) as archive:
        packed = set(archive.namelist())
    ours = {
        path.relative_to(SOURCE).as_posix()
        for path in (SOURCE / "hmpim").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert len(ours) > 300
    ours.add("hmpim_start.py")
    assert ours <= packed, sorted(ours - packed)
    assert {Path(name).suffix for name in ours} >= {".toml", ".j2", ".jinja", ".typed"}


ELSEWHERE = re.compile(r"\b(?:docs|tests|benchmarks|examples)/\w|\b[A-Z]{4,}\.md\b")


def said(path):
    """Words of a file that somebody may read: not a module's own docstring, not a comment."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py" or not ELSEWHERE.search(text):
        return [text]
    module = ast.parse(text)
    own = ast.get_docstring(module, clean=False)
    strings = [n.value for n in ast.walk(module) if isinstance(n, ast.Constant)]
    return [one for one in strings if isinstance(one, str) and one != own]


def test_no_words_of_the_package_lead_to_files_that_are_not_in_it():
    """Pages, help, messages and docstrings are read where there is no clone."""
    files = [p for p in (SOURCE / "hmpim").rglob("*") if p.is_file() and p.suffix != ".pyc"]
    assert len(files) > 300
    found = {path.name: s for path in files for s in said(path) if ELSEWHERE.search(s)}
    assert not found


OPENED = """
import sys
from importlib.resources import files
import hmpim
from hmpim.campaign.shipped import shipped_plan
from hmpim.formats.models import export
from hmpim.rigs.table import MotionTable
assert hmpim.__file__.startswith(sys.argv[1]), hmpim.__file__
for name in ("demo", "section_v_reduced"):
    assert "[" in shipped_plan(name).read_text(encoding="utf-8")
limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
stimulus = hmpim.design(band=(0.5, 20), duration=3, fs=200, limits=limits)
sensor = hmpim.Sensor(natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
result = hmpim.identify(hmpim.run(sensor, stimulus, rng=1))
hmpim.report(result, "page.html")
export(result, to="c", path="model")
export(result, to="modelica", path="model.mo")
MotionTable()
print("opened")
"""


def test_what_is_installed_opens_its_own_files(unpacked, tmp_path):
    """A page, a model of two kinds, the plans and the table's description, away from the clone."""
    done = python(unpacked, "-c", OPENED, str(unpacked), cwd=tmp_path)
    assert done.stdout.split() == ["opened"], done.stderr
    assert {path.name for path in tmp_path.iterdir()} >= {"page.html", "model", "model.mo"}


@pytest.mark.study
def test_the_demonstrations_run_from_the_wheel(unpacked, tmp_path):
    main = ("-m", "hmpim.cli.main")
    for arguments in (["demo"], ["campaign", "demo", "--out", "out/demo-table"]):
        done = python(unpacked, *main, *arguments, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert list(tmp_path.rglob("*.html"))


IMPORTED = """
import builtins, importlib, pkgutil, sys
blocked, plain = set(sys.argv[1].split()), builtins.__import__

def guarded(name, globals=None, locals=None, fromlist=(), level=0):
    who = (globals or {}).get("__name__", "")
    if not level and name.partition(".")[0] in blocked and who.partition(".")[0] == "hmpim":
        raise ImportError(f"{who} imports {name}, which Windows has not")
    return plain(name, globals, locals, fromlist, level)

builtins.__import__ = guarded
import hmpim
names = [m.name for m in pkgutil.walk_packages(hmpim.__path__, "hmpim.")]
for name in names:
    importlib.import_module(name)
print(len(names))
"""


def test_no_module_needs_what_windows_has_not():
    """Every module is imported with the modules of POSIX blocked; functions may ask for them."""
    environment = {**os.environ, "PYTHONPATH": str(SOURCE), "MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED, " ".join(POSIX_ONLY)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout.split()[-1]) > 200


def test_each_imports_what_it_uses_alone():
    """The package nothing, help no room of SciPy and no drawing, identification neither."""
    program = (
        "import sys\n"
        "import hmpim\nprint(*sys.modules)\n"
        "import hmpim.cli.main\n"
        "try:\n    hmpim.cli.main.app(['--help'])\n"
        "except SystemExit:\n    print()\n    print(*sys.modules)\n"
        "hmpim.identify, hmpim.read, hmpim.run\nprint(*sys.modules)\n"
    )
    lines = printed_by(program).splitlines()
    alone, with_help, identifying = (set(lines[place].split()) for place in (0, -2, -1))
    assert {name for name in alone if name.startswith("hmpim")} == {"hmpim"}
    assert not {"numpy", "scipy"} & alone
    slow = {
        *("matplotlib", "jinja2", "pandas", "plotly", "scipy.ndimage", "scipy.optimize"),
        *("scipy.signal", "scipy.special", "scipy.stats"),
    }
    assert "hmpim.cli.main" in with_help
    assert not (slow | {"hmpim.identify", "hmpim.batch", "hmpim.report"}) & with_help
    assert "hmpim.identify.identify" in identifying
    assert not slow & identifying
