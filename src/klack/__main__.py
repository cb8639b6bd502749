"""``python -m klack`` is the command ``klack``."""

import sys

from klack.cli.main import main

__all__: list[str] = []

if __name__ == "__main__":
    sys.exit(main())
