"""Write docs/licences.md: what each extra installs and under which licence, as installed.

Run: python benchmarks/licences.py
"""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, metadata, requires
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "licences.md"

HEAD = """# Licences

hmpim itself is under BSD-3-Clause. What it needs, and what each extra adds, is listed here as the
installed packages state it. `python benchmarks/licences.py` writes this page, and a test holds it
against what is installed.

hmpim imports these packages and ships none of them. It ships one file of another project, for
the live strip of the workbench: uPlot 1.6.32 (MIT, © 2022 Leon Sorokin), unchanged, with its
licence beside it in `src/hmpim/workbench/static/uplot`.

**Under the LGPL: {lgpl}.** They are extras,
imported as they are and changed nowhere, so that the LGPL asks nothing of code that uses hmpim;
who ships them in an application must let them be replaced.

ArduPilot logs are read by hmpim itself. pymavlink states the LGPL, but its module `DFReader.py`,
which reads such logs, is under the GPL by its own head: docs/decisions/0007-ardupilot-logs.md.
"""

_CLASSIFIERS = {
    "BSD License": "BSD",
    "MIT License": "MIT",
    "Apache Software License": "Apache-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "ISC License (ISCL)": "ISC",
    "GNU Lesser General Public License v3 or later (LGPLv3+)": "LGPL-3.0-or-later",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0",
}


# Its classifiers name the GPL for one file, an editing mode for Emacs, that no wheel holds.
_AS_INSTALLED = {"docutils": "Public Domain, BSD-2-Clause, BSD-3-Clause, PSF-2.0"}


def licence_of(name: str) -> str:
    """Licence of an installed package: its expression, a short name, or its classifiers."""
    if name.lower() in _AS_INSTALLED:
        return _AS_INSTALLED[name.lower()]
    about = metadata(name)
    expression = about.get("License-Expression")
    if expression:
        return str(expression)
    kinds = [c.split(" :: ")[-1] for c in about.get_all("Classifier") or () if "License ::" in c]
    if kinds:
        return ", ".join(sorted({_CLASSIFIERS.get(kind, kind) for kind in kinds}))
    stated = str(about.get("License") or "").strip()
    return stated if stated and len(stated) < 40 and "\n" not in stated else "see the package"


def needed(requirements: list[str], known: set[str]) -> list[str]:
    """Packages that requirements bring, in order, without those already known."""
    found = []
    for line in requirements:
        requirement = Requirement(line)
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        name = re.sub(r"[-_.]+", "-", requirement.name).lower()
        if name in known:
            continue
        known.add(name)
        found.append(metadata(requirement.name)["Name"])
        found += needed(requires(requirement.name) or [], known)
    return found


def tables() -> dict[str, list[tuple[str, str]]]:
    """Packages and licences by extra; '' is what hmpim itself needs."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    known: set[str] = set()
    found = {"": [(n, licence_of(n)) for n in needed(project["dependencies"], known)]}
    for extra, requirements in sorted(project["optional-dependencies"].items()):
        if extra != "all":
            # Each extra on its own: what two of them need stands in both.
            found[extra] = [(n, licence_of(n)) for n in needed(requirements, set(known))]
    return found


def page() -> str:
    """Return the page."""
    found = tables()
    lgpl = [
        f"{name} (extra `{extra}`)"
        for extra, rows in found.items()
        for name, licence in rows
        if "LGPL" in licence
    ]
    parts = [HEAD.format(lgpl=", ".join(lgpl))]
    for extra, rows in found.items():
        title = f"Extra `{extra}`" if extra else "Always"
        table = "\n".join(f"| {name} | {licence} |" for name, licence in rows)
        parts.append(f"## {title}\n\n| package | licence |\n| --- | --- |\n{table}\n")
    return "\n".join(parts)


def main() -> None:
    """Write the page."""
    try:
        PAGE.write_text(page(), encoding="utf-8")
    except PackageNotFoundError as error:
        raise SystemExit(f"{error}; install everything first: make install") from None


if __name__ == "__main__":
    main()
