"""Records on disk: one Zarr v3 store that any language with a Zarr reader can open.

Every record is a group, every array an array with its unit as an attribute, numbers and words are
attributes of the group.  Nothing is pickled.  A checksum beside each array finds lost chunks, which
a Zarr reader would silently take for zeros, and one of each group finds damaged words and numbers.
"""

import json
import os
import stat
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from math import isfinite, prod
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin, get_type_hints
from urllib.parse import quote
from zlib import crc32

import numpy as np

from klack.errors import InputError, refuse_if
from klack.files.own import kind_of
from klack.files.whole import completed, in_exchange, whole_file

__all__ = ["RESULT_NAME", "RecordFormat", "load_record", "save_record", "stored_format"]

Found = TypeVar("Found")

RESULT_NAME = "result.zarr"
_TRIES, _PAUSE = 10, 0.01  # [-], [s]: files move to their place in milliseconds
_CHUNK = 1 << 24  # [byte] of numbers in a file, before they are packed
_LARGEST = 4_000_000_000  # bytes; the largest results have some 100 MB


@dataclass(frozen=True, kw_only=True)
class RecordFormat:
    """Storage format of one kind of record.

    Parameters
    ----------
    kind
        Frozen dataclass of numbers, words, arrays and such records.
    command
        That makes it, for messages.
    units
        By name of the array.
    tables
        Long tuples of like records without arrays: an array per field.
    """

    name: str
    version: int
    kind: type
    command: str
    units: Mapping[str, str]
    tables: tuple[str, ...] = ()


def save_record(record: Any, folder: Path, form: RecordFormat) -> Path:
    """Write ``folder/result.zarr`` and return it.

    An earlier result stays whole until the new one is complete.
    """
    with whole_file(folder / RESULT_NAME) as new:
        _describe(new, "group", {"format": form.name, "format_version": form.version})
        _write(new / "study", "study", record, form)
    return folder / RESULT_NAME


def load_record(folder: Path, form: RecordFormat, *, largest: int = _LARGEST) -> Any:
    """Read what :func:`save_record` wrote, from its folder or the store itself.

    Arrays that together exceed ``largest`` [byte] are refused before they are read.  A result that
    another process replaces meanwhile is read again: no numbers of two results mix.
    """
    return _steadily(folder, lambda path: _load(path, form, largest))


def _steadily(folder: Path, read: Callable[[Path], Found]) -> Found:
    """Content of a store; read again if it was replaced meanwhile."""
    for _ in range(_TRIES):
        place = _find(folder)
        try:
            found = read(place[0])
        except InputError:
            if _find(folder) == place:
                raise
        else:
            if _find(folder) == place:
                return found
    raise _damaged(folder, "a result that keeps changing while it is read")


def _load(path: Path, form: RecordFormat, largest: int) -> Any:
    attributes = _open(path)
    refuse_if(
        attributes.get("format") != form.name,
        f"result {path}",
        got=f"a Zarr store with format {attributes.get('format')!r}",
        expected=f"{form.name!r}",
        hint=f"give the folder of a result written by `{form.command}`.",
    )
    version = attributes.get("format_version")
    refuse_if(
        version != form.version,
        f"result {path}",
        got=f"format version {version}",
        expected=f"version {form.version}",
        hint="read it with the version of klack that wrote it, or run the case again.",
    )
    try:
        record = _read(_nodes(path, largest), path / "study", form.kind)
    except InputError as error:
        raise _damaged(path, error.got) from error
    except Exception as error:  # whatever json, numpy and the codec say about missing or cut files
        raise _damaged(path, f"a part that cannot be read ({type(error).__name__}: {error})") from (
            error
        )
    if not isinstance(record, form.kind):
        raise _damaged(path, "no study in it")
    return record


def stored_format(folder: Path) -> str:
    """Name of the format of the result in a folder."""
    return _steadily(folder, lambda path: str(_open(path).get("format")))


def _open(path: Path) -> dict[str, Any]:
    _require_plain_files(path)
    try:
        return _described(path / "zarr.json")["attributes"]
    except Exception as error:  # kinds of json and of the file system
        raise _damaged(path, f"a store that does not open ({error})") from error


def _require_plain_files(path: Path) -> None:
    """Reject links, which lead out, and pipes, which block."""
    for place, folders, files in os.walk(path):
        for name in (*folders, *files):
            try:
                state = Path(place, name).lstat()
            except FileNotFoundError:  # replaced at this moment
                continue
            if stat.S_IFMT(state.st_mode) not in (stat.S_IFREG, stat.S_IFDIR):
                raise _damaged(path, f"{kind_of(state)} in it, {str(Path(place, name))!r}")


def _find(folder: Path) -> tuple[Path, tuple[int, int]]:
    """Place of a store, and what tells this very one from others: its number, and when it was made.

    The number alone is given again to the next folder.
    """
    if folder.name == RESULT_NAME:
        folder = folder.absolute().parent
    for _ in range(_TRIES):
        for path in (completed(folder) / RESULT_NAME, folder):
            try:
                if (path / "zarr.json").is_file():
                    state = path.stat()
                    return path, (state.st_ino, state.st_mtime_ns)
            except OSError:  # moved at this moment, or not for this user
                continue
        if not in_exchange(folder):
            break
        time.sleep(_PAUSE)
    raise InputError(
        f"result {folder}",
        got="no klack result" if folder.exists() else "a folder that does not exist",
        expected=f"a folder with '{RESULT_NAME}' in it",
        hint="run `klack impact CASE` or `klack stroke CASE` first, and give the folder that it "
        "names at the end.",
    )


def _damaged(path: Path, got: str) -> InputError:
    return InputError(
        f"result {path}",
        got=got,
        expected="a complete result",
        hint="copy the whole folder again, or run the case again.",
    )


# --------------------------------------------------------------------------- writing


def _describe(place: Path, kind: str, attributes: Mapping[str, Any], **more: Any) -> None:
    place.mkdir()
    words = {"attributes": attributes, "zarr_format": 3, "node_type": kind, **more}
    (place / "zarr.json").write_text(json.dumps(words, indent=2), encoding="utf-8")


def _write_array(place: Path, value: np.ndarray, attributes: Mapping[str, Any]) -> None:
    """Store numbers, some rows of the first axis in each file; the last one is filled up.

    zarr hands each file to a thread, and takes three times as long for a stroke.
    """
    from numcodecs.zstd import Zstd

    if value.dtype.kind not in "biufc":
        raise TypeError(f"store: an array of {value.dtype}")
    rows = max(1, min(len(value), _CHUNK // max(value[:1].nbytes, 1)))
    marks = {"crc32": _checksum(value), "stored": _kind(value)}
    one_byte = value.dtype.itemsize == 1
    zero = np.zeros((), value.dtype).item()
    _describe(
        place,
        "array",
        marks | dict(attributes),
        shape=value.shape,
        data_type=value.dtype.name,
        chunk_grid={
            "name": "regular",
            "configuration": {"chunk_shape": (rows, *(max(n, 1) for n in value.shape[1:]))},
        },
        chunk_key_encoding={"name": "default", "configuration": {"separator": "/"}},
        fill_value=[0.0, 0.0] if isinstance(zero, complex) else zero,
        codecs=[
            {"name": "bytes"} | ({} if one_byte else {"configuration": {"endian": "little"}}),
            {"name": "zstd", "configuration": {"level": 0, "checksum": False}},
        ],
        storage_transformers=[],
    )
    for i in range(-(-len(value) // rows) if value.size else 0):
        part = np.zeros((rows, *value.shape[1:]), value.dtype.newbyteorder("<"))
        given = value[i * rows : (i + 1) * rows]
        part[: len(given)] = given
        file = place.joinpath("c", f"{i}", *("0" for _ in value.shape[1:]))
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(Zstd(level=0).encode(part))


def _write(place: Path, name: str, value: Any, form: RecordFormat) -> None:
    if isinstance(value, np.ndarray):
        _write_array(place, value, {"unit": form.units[name]} if name in form.units else {})
        return
    table = name in form.tables and len(value) > 0
    if table:
        members = _columns(value)
    elif is_dataclass(value):
        members = {field.name: getattr(value, field.name) for field in fields(value)}
    elif isinstance(value, Mapping):
        members = dict(value)
    else:
        members = {str(i): member for i, member in enumerate(value)}
    children = {key: member for key, member in members.items() if _has_arrays(member)}
    plain = {key: _plain(member) for key, member in members.items() if key not in children}
    # the order of a mapping is part of it, and a zarr group does not keep it
    order = list(members)
    marks = {"table": True} if table else {}
    check = _words_checksum(plain, order)
    _describe(place, "group", {"values": plain, "order": order, "crc32": check, **marks})
    for key, member in children.items():
        _write(place / quote(key, safe=" "), key, member, form)


def _columns(records: Sequence[Any]) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for field in fields(records[0]):
        values = [getattr(record, field.name) for record in records]
        columns[field.name] = tuple(values) if isinstance(values[0], str) else np.array(values)
    return columns


def _has_arrays(value: Any) -> bool:
    if isinstance(value, Mapping):
        return any(map(_has_arrays, value.values()))
    if isinstance(value, tuple | list):
        return any(map(_has_arrays, value))
    return isinstance(value, np.ndarray) or is_dataclass(value)


def _plain(value: Any) -> Any:
    """JSON has no infinity: such numbers become text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(member) for key, member in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(member) for member in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not isfinite(value):
        return str(value)
    return value


def _checksum(array: np.ndarray) -> int:
    return crc32(np.ascontiguousarray(array).tobytes())


def _kind(array: np.ndarray) -> str:
    """Type and shape, without which bytes mean nothing."""
    return f"{array.dtype.str} {'x'.join(map(str, array.shape))}"


def _words_checksum(values: Mapping[str, Any], order: list[str]) -> int:
    # the shortest text of a double is read back exactly, so that this text is the same again
    return crc32(json.dumps([values, order], sort_keys=True).encode())


# --------------------------------------------------------------------------- reading


def _described(file: Path) -> dict[str, Any]:
    about = json.loads(file.read_text(encoding="utf-8"))
    known = isinstance(about, dict) and isinstance(about.get("attributes"), dict)
    if not known or about.get("zarr_format") != 3:
        raise _incomplete(f"a description that cannot be read in '{file.parent.name}'")
    return about


def _nodes(path: Path, largest: int) -> dict[Path, dict[str, Any]]:
    """Descriptions by place, after all sizes are checked."""
    found = {
        Path(place): _described(Path(place, "zarr.json"))
        for place, _, files in os.walk(path)
        if "zarr.json" in files
    }
    arrays = [about for about in found.values() if about.get("node_type") == "array"]
    if sum(prod(about["shape"]) * _dtype(about).itemsize for about in arrays) > largest:
        raise _incomplete(f"arrays of more than {largest / 1e9:.3g} GB")
    return found


def _dtype(about: Mapping[str, Any]) -> np.dtype[Any]:
    """Type of the stored numbers; raises for all but numbers."""
    found = np.dtype(about["data_type"])
    if found.kind not in "biufc" or found.name != about["data_type"] or min(about["shape"]) < 0:
        raise _incomplete("an array that does not contain numbers")
    return found.newbyteorder("<")


def _read_array(place: Path, about: Mapping[str, Any]) -> np.ndarray:
    """Numbers of an array of a regular grid of packed files; one that is not there has zeros.

    zarr takes 0.3 s to load, and reads each file through a thread.
    """
    from numcodecs.zstd import Zstd

    shape, chunk = tuple(about["shape"]), tuple(about["chunk_grid"]["configuration"]["chunk_shape"])
    fits = all(0 < part <= max(whole, 1) for whole, part in zip(shape, chunk, strict=True))
    endian = about["codecs"][0].get("configuration", {}).get("endian", "little")
    if not fits or [c["name"] for c in about["codecs"]] != ["bytes", "zstd"] or endian != "little":
        raise _incomplete(f"an array of an unknown type in '{place.name}'")
    values = np.zeros(shape, _dtype(about))
    for file in (place / "c").glob("/".join("*" * len(shape))):
        part = np.zeros(chunk, values.dtype)
        if file.stat().st_size > 2 * part.nbytes + 1000:  # packed ones are hardly longer
            raise _incomplete(f"too many numbers in '{place.name}'")
        Zstd().decode(file.read_bytes(), out=part)  # raises where more than a part is in it
        first = [int(i) * n for i, n in zip(file.parts[-len(shape) :], chunk, strict=True)]
        to = values[tuple(slice(i, i + n) for i, n in zip(first, chunk, strict=True))]
        to[...] = part[tuple(map(slice, to.shape))]
    return values.astype(values.dtype.newbyteorder("="), copy=False)


def _read(nodes: Mapping[Path, dict[str, Any]], place: Path, hint: Any) -> Any:
    about = nodes[place]
    attributes = about["attributes"]
    if about.get("node_type") == "array":
        values = _read_array(place, about)
        # results of klack 0.1 before this mark was written have none
        kept = attributes.get("stored", _kind(values)) == _kind(values)
        if not kept or _checksum(values) != attributes.get("crc32"):
            raise _incomplete(f"damaged numbers in '{place.name}'")
        return values
    plain, order = attributes.get("values"), attributes.get("order")
    if not isinstance(plain, dict) or not isinstance(order, list):
        raise _incomplete(f"no values in '{place.name}'")
    mark = _words_checksum(plain, order)
    if attributes.get("crc32", mark) != mark:
        raise _incomplete(f"damaged values in '{place.name}'")

    def member(name: str, kind: Any) -> Any:
        return _read(nodes, place / quote(name, safe=" "), kind)

    if is_dataclass(hint):
        return _read_record(place, hint, plain, order, member)
    if attributes.get("table"):
        return _read_table(_element(hint, 0), plain, order, member)
    kinds = [_element(hint, i) for i in range(len(order))]
    members = {
        key: _convert(plain[key], kind) if key in plain else member(key, kind)
        for key, kind in zip(order, kinds, strict=True)
    }
    return members if _is_mapping(hint) else tuple(members.values())


def _read_record(
    place: Path,
    kind: Any,
    plain: Mapping[str, Any],
    order: list[str],
    member: Callable[[str, Any], Any],
) -> Any:
    hints = _hints(kind)
    members = {}
    for field in fields(kind):
        if field.name in plain:
            members[field.name] = _convert(plain[field.name], hints[field.name])
        elif field.name in order:
            members[field.name] = member(field.name, _without_none(hints[field.name]))
        elif field.default is MISSING and field.default_factory is MISSING:
            raise _incomplete(f"no '{field.name}' in '{place.name}'")
    return kind(**members)


def _read_table(
    kind: Any, plain: Mapping[str, Any], order: list[str], member: Callable[[str, Any], Any]
) -> tuple[Any, ...]:
    columns = {name: plain[name] if name in plain else member(name, Any).tolist() for name in order}
    known = [field.name for field in fields(kind) if field.name in columns]
    return tuple(
        kind(**dict(zip(known, row, strict=True)))
        for row in zip(*(columns[name] for name in known), strict=True)
    )


@cache
def _hints(kind: Any) -> dict[str, Any]:
    return get_type_hints(kind)


def _incomplete(got: str) -> InputError:
    return InputError("result", got=got, expected="a complete result", hint="run it again.")


def _convert(value: Any, hint: Any) -> Any:
    hint = _without_none(hint)
    if value is None:
        return None
    if hint is float:
        return float(value)
    if isinstance(value, list):
        return tuple(_convert(member, _element(hint, i)) for i, member in enumerate(value))
    if isinstance(value, dict):
        return {key: _convert(member, _element(hint, 0)) for key, member in value.items()}
    return value


def _without_none(hint: Any) -> Any:
    """``X`` for ``X | None``."""
    kinds = [kind for kind in get_args(hint) if kind is not type(None)]
    return kinds[0] if type(None) in get_args(hint) and len(kinds) == 1 else hint


def _is_mapping(hint: Any) -> bool:
    origin = get_origin(hint)
    return isinstance(origin, type) and issubclass(origin, Mapping)


def _element(hint: Any, index: int) -> Any:
    """Declared kind of member ``index`` of a tuple or of a value of a mapping."""
    arguments = get_args(hint)
    if not arguments:
        return Any
    if _is_mapping(hint):
        return arguments[1]
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return arguments[0]
    return arguments[min(index, len(arguments) - 1)]
