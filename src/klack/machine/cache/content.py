"""A key for content: equal keys mean equal numbers, whatever their name or date.

Every value is written with its kind and length in front, so that different contents never have
the same bytes.  Names of files are refused: what counts is what is in them.
"""

import hashlib
import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

__all__ = ["content_key"]


def content_key(*parts: object) -> str:
    """SHA-256 over values, as 64 hexadecimal digits.

    Parameters
    ----------
    parts
        None, numbers, str, bytes, arrays, sparse rows, tuples, lists, mappings (their order counts,
        it numbers solids) and dataclasses of these; TypeError for others.

    Examples
    --------
    >>> content_key(1.0, "a") == content_key(1.0, "a")
    True
    >>> content_key(("ab", "c")) == content_key(("a", "bc"))
    False
    """
    digest = hashlib.sha256()
    _feed(digest, parts)
    return digest.hexdigest()


def _feed(digest: Any, value: object) -> None:
    if isinstance(value, np.generic):
        value = value.item()
    if value is None:
        _mark(digest, b"none", 0)
    elif isinstance(value, (bool, int)):
        _raw(digest, type(value).__name__.encode(), str(value).encode())
    elif isinstance(value, float):
        _raw(digest, b"float", struct.pack("<d", value))
    elif isinstance(value, str):
        _raw(digest, b"str", value.encode())
    elif isinstance(value, bytes):
        _raw(digest, b"bytes", value)
    elif isinstance(value, np.ndarray):
        _feed_array(digest, value)
    elif isinstance(value, (tuple, list)):
        _mark(digest, b"sequence", len(value))
        for item in value:
            _feed(digest, item)
    elif isinstance(value, Mapping):
        _mark(digest, b"mapping", len(value))
        for name, item in value.items():
            _feed(digest, name)
            _feed(digest, item)
    elif is_dataclass(value) and not isinstance(value, type):
        _feed_record(digest, value)
    elif all(hasattr(value, name) for name in ("indptr", "indices", "data", "shape")):
        _mark(digest, b"sparse rows", 0)
        for name in ("shape", "indptr", "indices", "data"):
            _feed(digest, getattr(value, name))
    else:
        raise TypeError(f"content_key: a {type(value).__name__} has no content that counts")


def _feed_array(digest: Any, array: np.ndarray) -> None:
    if array.dtype.hasobject:
        raise TypeError("content_key: an array of Python objects")
    # products of the same numbers in another order of storage may differ in the last bit
    columns = array.flags.f_contiguous and not array.flags.c_contiguous
    layout = "F" if columns else "C"
    _feed(digest, ("array", array.dtype.str, array.shape, layout))
    flat = np.ascontiguousarray(array.T if columns else array)
    digest.update(flat.reshape(-1).view(np.uint8).data)


def _feed_record(digest: Any, record: Any) -> None:
    given = [field for field in fields(record) if field.init]
    _raw(digest, b"record", type(record).__qualname__.encode())
    _mark(digest, b"fields", len(given))
    for field in given:
        _feed(digest, field.name)
        _feed(digest, getattr(record, field.name))


def _raw(digest: Any, kind: bytes, content: bytes) -> None:
    _mark(digest, kind, len(content))
    digest.update(content)


def _mark(digest: Any, kind: bytes, length: int) -> None:
    digest.update(b"%s %d\n" % (kind, length))
