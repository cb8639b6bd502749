"""``python -m klack`` is the command ``klack``."""

import os
import sys
from contextlib import suppress

# "-m" puts the present folder in front of all modules, where a stranger's numpy.py may lie
if sys.path and not sys.flags.safe_path:
    with suppress(OSError):  # the folder is gone: nothing lies there
        if os.path.samefile(sys.path[0] or os.curdir, os.curdir):
            del sys.path[0]

from klack.cli.main import main

__all__: list[str] = []

if __name__ == "__main__":
    sys.exit(main())
