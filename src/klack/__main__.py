"""``python -m klack`` is the command ``klack``."""

import sys
from pathlib import Path

# "-m" puts the present folder in front of all modules, where a stranger's numpy.py may lie
if sys.path and not sys.flags.safe_path and Path(sys.path[0]) == Path.cwd():
    del sys.path[0]

from klack.cli.main import main

__all__: list[str] = []

if __name__ == "__main__":
    sys.exit(main())
