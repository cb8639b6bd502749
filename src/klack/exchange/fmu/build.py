"""Build an FMU: sources, binaries, model description, documentation, in one zip file."""

import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Literal
from uuid import UUID

import numpy as np
from numpy.typing import ArrayLike

from klack.contact.step_constants import LANES, NO_LAW, shared_constants
from klack.errors import refuse_if
from klack.exchange.fmu.compiler import PLATFORMS, compile_library, require_compilers, this_platform
from klack.exchange.fmu.documentation import documentation_files
from klack.exchange.fmu.model_description import (
    SOURCE_FILES,
    build_description,
    model_description,
    supports_model_exchange,
)
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import ModalModel
from klack.files.whole import whole_file

__all__ = ["build_fmu", "data_header", "source_texts"]


def data_header(model: ModalModel, guid: str) -> str:
    """Text of the header.

    Names and counts are seen by every source file; arrays only by the one that defines
    ``KLACK_ARRAYS`` before.  Numbers have 17 digits: the compiler reads the same double.

    Parameters
    ----------
    guid
        Shown by an importing program at instantiation.
    """
    variables = fmu_variables(model)
    names = [variable.name for variable in variables]
    states = [variable for variable in variables if variable.derivative_of is None][
        -2 * model.mode_count :
    ]
    m = model.mode_count
    films = [contact.film for contact in model.contacts]
    laws = [None if c.law is None else c.law.flat() for c in model.contacts]
    sizes = [0 if law is None else law.parameters.size for law in laws]
    speed = next((v.start for v in variables if v.name == "start_velocity"), 0.0)
    first_of_contact = [
        len(model.inputs) + len(model.outputs) + sum(4 if film is None else 5 for film in films[:c])
        for c in range(len(films) + 1)
    ]
    lines = [
        f"/* Numbers of the model {model.name}, SI units; written by klack. */",
        "#ifndef KLACK_DATA_H",
        "#define KLACK_DATA_H",
        "",
        f"#define KLACK_SYMBOL(name) {model.name}_##name",
        f'#define KLACK_NAME "{model.name}"',
        f'#define KLACK_GUID "{guid}"',
        f"#define KLACK_MODES {m}",
        f"#define KLACK_PADDED {_padded(m)}",
        f"#define KLACK_INPUTS {len(model.inputs)}",
        f"#define KLACK_OUTPUTS {len(model.outputs)}",
        f"#define KLACK_CONTACTS {len(model.contacts)}",
        f"#define KLACK_FILMS {sum(film is not None for film in films)}",
        f"#define KLACK_PAIR {int(model.kind == 'pair')}",
        f"#define KLACK_VARIABLES {len(variables)}",
        f"#define KLACK_INTERNAL_STEP {names.index('internal_step')} /* value reference */",
        f"#define KLACK_HAS_MODEL_EXCHANGE {int(supports_model_exchange(model))}",
        "",
        "#ifdef KLACK_ARRAYS",
        _number("klack_default_step", model.step),
        _number("klack_default_velocity", 0.0 if speed is None else speed),
        _array("klack_omega", model.omega),
        _array("klack_damping", model.damping),
        _array("klack_start", model.start),
        _array("klack_start_speed", model.start_velocity),
        _array("klack_rise", model.rise),
        _array("klack_constant", model.constant),
        _array("klack_nominal", [v.nominal if v.nominal is not None else 1.0 for v in states]),
        _rows("klack_input", [item.shape for item in model.inputs], m),
        _rows("klack_output", [item.shape for item in model.outputs], m),
        _array("klack_output_offset", [item.offset for item in model.outputs]),
        _integers("klack_output_moves", [item.quantity == "velocity" for item in model.outputs]),
        _rows("klack_gap_row", [contact.shape for contact in model.contacts], _padded(m)),
        _array("klack_gap", [contact.gap for contact in model.contacts]),
        _array("klack_series", [contact.series_compliance for contact in model.contacts]),
        _integers("klack_contact_first", first_of_contact),
        _integers("klack_law_kind", [NO_LAW if law is None else law.kind for law in laws]),
        _integers("klack_law_first", np.concatenate(([0], np.cumsum(sizes)))),
        _array(
            "klack_law",
            np.concatenate([np.empty(0), *(w.parameters for w in laws if w is not None)]),
        ),
        _array("klack_dissipation", [0.0 if law is None else law.dissipation for law in laws]),
        _integers("klack_has_film", [film is not None for film in films]),
        _array("klack_cubic", [0.0 if film is None else film.cubic for film in films]),
        _array("klack_linear", [0.0 if film is None else film.linear for film in films]),
        _array("klack_cut_off", [1.0 if film is None else film.cut_off for film in films]),
        _array("klack_suction", [0.0 if film is None else film.suction for film in films]),
        "#endif",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def constants_header() -> str:
    """Text of ``klack_constants.h``: constants shared with klack's time step."""
    lines = [
        f"#define KLACK_{name} ({value}) /* {meaning} */"
        for name, value, meaning in shared_constants("C")
    ]
    head = [
        "/* Constants of laws and steps, SI units; written by klack. */",
        "#ifndef KLACK_CONSTANTS_H",
        "#define KLACK_CONSTANTS_H",
        "",
    ]
    return "\n".join([*head, *lines, "", "#endif"]) + "\n"


def _padded(modes: int) -> int:
    """Mode count, filled up so that loops need no rest."""
    return LANES * max(1, -(-modes // LANES))


def _number(name: str, value: float) -> str:
    return f"static const double {name} = {_digits(name, value)};"


def _array(name: str, values: ArrayLike) -> str:
    """One array; an empty one gets a zero, as C requires."""
    numbers = [_digits(name, x) for x in np.asarray(values, dtype=float).ravel()] or ["0"]
    return f"static const double {name}[{len(numbers)}] = {{{_wrapped(numbers)}}};"


def _rows(name: str, rows: Sequence[ArrayLike], width: int) -> str:
    """Rows, filled up with zeros to ``width``."""
    table = np.zeros((max(len(rows), 1), max(width, 1)))
    for i, row in enumerate(rows):
        given = np.asarray(row, dtype=float)
        table[i, : given.size] = given
    parts = [f"{{{_wrapped([_digits(name, x) for x in row])}}}" for row in table]
    head = f"static const double {name}[{table.shape[0]}][{table.shape[1]}]"
    return f"{head} = {{\n{','.join(parts)}}};"


def _integers(name: str, values: ArrayLike) -> str:
    numbers = [str(int(x)) for x in np.asarray(values).ravel()] or ["0"]
    return f"static const int {name}[{len(numbers)}] = {{{_wrapped(numbers)}}};"


def _digits(name: str, value: float) -> str:
    refuse_if(
        not np.isfinite(value),
        f"export of a model: {name.removeprefix('klack_')}",
        got=f"{value}",
        expected="finite numbers",
        hint="check the body or the law of this model.",
    )
    return f"{float(value):.17g}"


def _wrapped(numbers: Sequence[str]) -> str:
    """Ten numbers to a line."""
    return ",\n".join(",".join(numbers[i : i + 10]) for i in range(0, len(numbers), 10))


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
    """Write an FMU with model exchange and co-simulation, sources and binaries, or nothing.

    Parameters
    ----------
    model
        Its name is the model identifier.
    path
        A file there is replaced.
    fmi
        Version of the standard.
    platforms
        Of :data:`klack.exchange.fmu.compiler.PLATFORMS`; default: of this program.  An importing
        program may compile the sources inside.
    """
    refuse_if(
        fmi not in SOURCE_FILES,
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
    """Files of the folder ``sources``: all that a C99 compiler needs."""
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
    """Of all numbers and sources: other models have another."""
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
    """Write under another name, then move."""
    with whole_file(path) as new, zipfile.ZipFile(new, "w", zipfile.ZIP_DEFLATED) as archive:
        for inside in sorted(files):
            archive.writestr(_entry(inside), files[inside])


def _entry(name: str) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name, _MADE)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    return entry
