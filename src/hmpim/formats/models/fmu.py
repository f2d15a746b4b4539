"""FMU for co-simulation, FMI 2.0 or 3.0: our C inside, and libraries that need nothing else."""

import hashlib
import html
import tempfile
import warnings
import zipfile
from pathlib import Path
from typing import Any, Literal

from hmpim.errors import ArgumentError
from hmpim.formats.atomic import replacing
from hmpim.formats.models.c import accuracy, c_files
from hmpim.formats.models.compile import PLATFORMS, can_compile, compile_library
from hmpim.formats.models.render import c_number, rendered
from hmpim.formats.models.source import Source

__all__ = ["FmiVersion", "SourcesOnly", "write_fmu"]

FmiVersion = Literal[2, 3]

_OTHERS = (
    *(("Float32", "float"), ("Int8", "int8_t"), ("UInt8", "uint8_t"), ("Int16", "int16_t")),
    *(("UInt16", "uint16_t"), ("Int32", "int32_t"), ("UInt32", "uint32_t")),
    *(("Int64", "int64_t"), ("UInt64", "uint64_t"), ("Boolean", "bool")),
)
"""Types of FMI 3 that the model has no variable of."""

_EPOCH = (1980, 1, 1, 0, 0, 0)


class SourcesOnly(UserWarning):
    """An FMU was written without libraries; an importer must compile its sources."""


def write_fmu(source: Source, path: Path, *, fmi: int = 2) -> tuple[Path, ...]:
    """Write the FMU: sources always, libraries if the extra `fmu` is installed.

    Raises
    ------
    ArgumentError
        If the version is neither 2 nor 3, or the model's names are no names in an FMU.

    Warns
    -----
    SourcesOnly
        If there are no libraries in it.
    """
    if fmi not in (2, 3):
        raise ArgumentError(
            f"fmi = {fmi!r} is not a version of FMI that can be written; give 2 or 3"
        )
    files = _texts(source, 2 if fmi == 2 else 3)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
        if can_compile():
            _add_libraries(folder, source.name, fmi)
        else:
            warnings.warn(
                f"{path.name} holds sources only, which many importers cannot run; for libraries "
                "install the extra: pip install 'hmpim[fmu]'",
                SourcesOnly,
                stacklevel=3,
            )
        with replacing(path) as whole, zipfile.ZipFile(whole, "w") as archive:
            for file in sorted(folder.rglob("*")):
                if file.is_file():
                    entry = zipfile.ZipInfo(file.relative_to(folder).as_posix(), _EPOCH)
                    entry.external_attr = 0o644 << 16
                    entry.compress_type = zipfile.ZIP_DEFLATED
                    archive.writestr(entry, file.read_bytes())
    return (path,)


def _add_libraries(folder: Path, name: str, fmi: int) -> None:
    sources = [folder / "sources" / f"{name}.c", folder / "sources" / f"fmi{fmi}.c"]
    for platform in PLATFORMS:
        where = platform.fmi2 if fmi == 2 else platform.fmi3
        if where is None:
            continue
        place = folder / "binaries" / where
        place.mkdir(parents=True)
        compile_library(sources, place / f"{name}{platform.suffix}", platform)
        for left in place.iterdir():  # import libraries and symbols
            if left.suffix != platform.suffix:
                left.unlink()


def _texts(source: Source, fmi: FmiVersion) -> dict[str, str]:
    chain = source.chain()
    program = c_files(source, chain)
    lines = source.program_lines(stepped=True)
    estimates = list(source.estimates())
    digest = hashlib.sha256("".join(program.values()).encode()).hexdigest()
    context: dict[str, Any] = {
        "name": source.name,
        "version": source.version,
        "token": f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}",
        "constants": [e.value for _, e in estimates] or [0.0],
        "step": c_number(1.0 / source.fs),
        "stop": source.record.samples / source.record.fs,
        "record": source.record.sha256,
        "summary": " ".join(lines[:3]) + " " + accuracy(chain),
        "input": source.pair.input,
        "output": source.pair.output,
        "unit": source.model.output_unit,
        "parameters": [
            {"name": name, "value": e.value, "said": line.strip()}
            for (name, e), line in zip(estimates, lines[4 : 4 + len(estimates)], strict=True)
        ],
        "others": _OTHERS,
    }
    shown = "\n".join([*lines, accuracy(chain)])
    page = f"<!DOCTYPE html><title>{source.name}</title><pre>{html.escape(shown)}</pre>\n"
    files = {
        "modelDescription.xml": rendered(f"modelDescription{fmi}.xml.jinja", **context),
        "documentation/index.html": page,
        f"sources/fmi{fmi}.c": rendered(f"fmi{fmi}.c.jinja", **context),
        **{f"sources/{name}": text for name, text in program.items()},
    }
    if fmi == 3:
        files["sources/buildDescription.xml"] = rendered("buildDescription.xml.jinja", **context)
    return files
