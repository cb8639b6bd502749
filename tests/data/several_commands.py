"""Run several commands of klack in one process: a JSON list of lists of words in, codes out.

Prints a JSON list with exit code and text on stderr of each.
"""

import contextlib
import io
import json
import sys

from klack.cli.main import main

found = []
for words in json.loads(sys.argv[1]):
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = main(words)
    found.append([code, said.getvalue()])
print(json.dumps(found))
