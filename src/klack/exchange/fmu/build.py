"""Build an FMU: sources, binaries, model description, documentation, in one zip file."""

import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Literal
from uuid import UUID

from klack.errors import InputError
from klack.exchange.fmu.build_description import build_description
from klack.exchange.fmu.compiler import (
    PLATFORMS,
    compile_library,
    require_compilers,
    this_platform,
)
from klack.exchange.fmu.data_header import constants_header, data_header
from klack.exchange.fmu.documentation import documentation_files
from klack.exchange.fmu.model_description import SOURCE_FILES, model_description
from klack.exchange.modal_model import ModalModel
from klack.whole_file import whole_file

__all__ = ["build_fmu", "source_texts"]

_HERE = Path(__file__).parent
_HEADERS = (
    "klack_film.h",
    "klack_law.h",
    "klack_model.h",
    "klack_propagator.h",
    "klack_state.h",
    "klack_steps.h",
)
_MADE = (1980, 1, 1, 0, 0, 0)  # time of all files: the same model gives the same FMU


def build_fmu(
    model: ModalModel, path: Path, *, fmi: Literal[2, 3], platforms: Sequence[str] | None = None
) -> Path:
    """Write an FMU with model exchange and co-simulation, sources and binaries.

    The file is written whole or not at all.

    Parameters
    ----------
    model : ModalModel
        Its name is the model identifier.
    path : Path
        Of the FMU; a file there is replaced.
    fmi : 2 or 3
        Version of the standard.
    platforms : sequence of str, optional
        Of the binaries, see :data:`klack.exchange.fmu.compiler.PLATFORMS`; that of this program by
        default.  The sources are inside, so an importing program may compile its own.

    Returns
    -------
    Path
        ``path``.

    Raises
    ------
    InputError
        Without a compiler, or for another version.
    """
    if fmi not in SOURCE_FILES:
        raise InputError(
            "build_fmu: fmi",
            got=f"{fmi}",
            expected="2 or 3",
            hint="more programs read version 2.",
        )
    wanted = (this_platform(),) if platforms is None else tuple(dict.fromkeys(platforms))
    require_compilers(wanted)
    guid = _guid(model, fmi)
    texts = source_texts(model, fmi, guid)
    files = {f"sources/{name}": text for name, text in texts.items()}
    files["modelDescription.xml"] = model_description(model, fmi=fmi, guid=guid).encode()
    files |= documentation_files(model, fmi=fmi)
    with tempfile.TemporaryDirectory() as folder:
        files |= _binaries(model, fmi, texts, Path(folder), wanted)
    _write(path, files)
    return path


def source_texts(model: ModalModel, fmi: Literal[2, 3], guid: str) -> dict[str, bytes]:
    """Files of the folder ``sources`` by name: all that a C99 compiler needs."""
    names = (*SOURCE_FILES[fmi], *_HEADERS)
    texts = {name: (_HERE / "sources" / name).read_bytes() for name in names}
    standard = sorted((_HERE / "headers" / f"fmi{fmi}").glob("*.h"))
    texts |= {file.name: file.read_bytes() for file in standard}
    texts["klack_constants.h"] = constants_header().encode()
    texts["klack_data.h"] = data_header(model, guid).encode()
    if fmi == 3:
        texts["buildDescription.xml"] = build_description(model).encode()
    return texts


def _guid(model: ModalModel, fmi: Literal[2, 3]) -> str:
    """Made of all numbers and sources: another model has another one."""
    texts = source_texts(model, fmi, "")
    digest = sha256(b"\0".join(texts[name] for name in sorted(texts)))
    return f"{{{UUID(bytes=digest.digest()[:16])}}}"


def _binaries(
    model: ModalModel,
    fmi: Literal[2, 3],
    texts: Mapping[str, bytes],
    folder: Path,
    platforms: Sequence[str],
) -> dict[str, bytes]:
    for name, text in texts.items():
        (folder / name).write_bytes(text)
    found = {}
    for name in platforms:
        target = PLATFORMS[name]
        library = folder / f"{model.name}{target.suffix}"
        library.unlink(missing_ok=True)
        sources = [folder / source for source in SOURCE_FILES[fmi]]
        compile_library(sources, [folder], library, platform=name)
        found[f"binaries/{target.folder(fmi)}/{library.name}"] = library.read_bytes()
    return found


def _write(path: Path, files: Mapping[str, bytes]) -> None:
    """Write under another name first, then move: there is never a partial FMU."""
    with whole_file(path) as new, zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
        for inside in sorted(files):
            archive.writestr(_entry(inside), files[inside])


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _MADE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    return entry
