"""Exchange of two names in one step."""

import ctypes
import errno
import os
import sys
from collections.abc import Callable
from functools import cache
from typing import Any

__all__ = ["swap_names"]

_SWAP = 2  # RENAME_EXCHANGE of Linux (renameat2), RENAME_SWAP of macOS (renameatx_np)
_UNABLE = (errno.ENOSYS, errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP)


def swap_names(first_folder: int, first: str, second_folder: int, second: str) -> bool:
    """Exchange entries of two folders; False, and nothing done, where the system cannot."""
    call = _system_call()
    if call is None:
        return False
    sys.audit("klack.swap_names", first, second, first_folder, second_folder)
    if call(first_folder, os.fsencode(first), second_folder, os.fsencode(second), _SWAP) == 0:
        return True
    number = ctypes.get_errno()
    if number in _UNABLE:
        return False
    raise OSError(number, os.strerror(number), second)


@cache
def _system_call() -> Callable[..., Any] | None:
    names = {"linux": "renameat2", "darwin": "renameatx_np"}
    try:
        library = ctypes.CDLL(None, use_errno=True)
        call = getattr(library, names[sys.platform])
    except (KeyError, OSError, AttributeError, TypeError):
        return None
    call.argtypes = (ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_uint)
    call.restype = ctypes.c_int
    return call
