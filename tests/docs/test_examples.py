"""What stands in examples/ runs as its first lines say."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_the_readmes_picture_is_made_again(tmp_path):
    made = tmp_path / "bode.png"
    command = [sys.executable, "examples/bode_picture.py", str(made)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    shown = (ROOT / "docs" / "images" / "bode.png").read_bytes()
    sizes = [picture[16:24] for picture in (made.read_bytes(), shown)]  # of the PNG header
    assert sizes[0] == sizes[1]
