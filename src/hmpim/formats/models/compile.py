"""Shared libraries for Linux, Windows and macOS from C, by the cross-compiler in ziglang."""

import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from hmpim.errors import FormatError

__all__ = ["PLATFORMS", "Platform", "can_compile", "compile_library"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Platform:
    """A platform: zig's name, FMI's names for it (None where FMI 2 has none), the suffix."""

    target: str
    fmi2: str | None
    fmi3: str
    suffix: str


PLATFORMS = (
    Platform(target="x86_64-linux-gnu.2.17", fmi2="linux64", fmi3="x86_64-linux", suffix=".so"),
    Platform(target="aarch64-linux-gnu.2.17", fmi2=None, fmi3="aarch64-linux", suffix=".so"),
    Platform(target="x86_64-windows-gnu", fmi2="win64", fmi3="x86_64-windows", suffix=".dll"),
    Platform(target="x86_64-macos", fmi2="darwin64", fmi3="x86_64-darwin", suffix=".dylib"),
    Platform(target="aarch64-macos", fmi2=None, fmi3="aarch64-darwin", suffix=".dylib"),
)


def can_compile() -> bool:
    """Whether the extra `fmu` is installed."""
    return find_spec("ziglang") is not None


def compile_library(sources: list[Path], library: Path, platform: Platform) -> None:
    """Compile C99 into a shared library for a platform, with no warning left.

    Raises
    ------
    FormatError
        If the compiler refuses; its first lines are in the message.
    """
    own = {
        ".so": ["-lm"],
        ".dll": [],
        # Without a name of its own the library would hold the folder in which it was compiled.
        ".dylib": ["-lm", f"-Wl,-install_name,@rpath/{library.name}"],
    }
    done = subprocess.run(
        [
            *(sys.executable, "-m", "ziglang", "cc", "-target", platform.target),
            *("-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-s", "-fPIC", "-shared"),
            *("-fvisibility=hidden", "-o", str(library)),
            *(str(source) for source in sources),
            *own[platform.suffix],
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode or not library.is_file():
        raise FormatError(
            f"the library for {platform.fmi3} cannot be compiled: {done.stderr.strip()[:300]}"
        )
