"""One self-contained page of a view: no server, no request, nothing but the file.

The component and three.js are modules for other programs; a page that is opened from a file may
load none, so both become one classic script here.
"""

import json
import re
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from klack.viewer.payload import payload_of
from klack.viewer.view import View

__all__ = ["page_of"]

_IMPORT = "import * as THREE from './three.min.js';\n"


def page_of(view: View) -> str:
    """HTML of a view."""
    environment = Environment(
        loader=PackageLoader("klack.viewer", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        title=view.title,
        source=view.source,
        version=view.version,
        payload=Markup(_json(payload_of(view))),
        script=Markup(_script()),
    )


def _json(payload: dict[str, object]) -> str:
    """JSON that ends no element and starts no comment of HTML."""
    text = json.dumps(payload, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


@cache
def _script() -> str:
    """The component and three.js as one classic script."""
    room = files("klack.viewer")
    library = room.joinpath("three.min.js").read_text(encoding="utf-8")
    scene = room.joinpath("scene.js").read_text(encoding="utf-8")
    body, found, names = library.rpartition("export{")
    assert found, "three.min.js as it is shipped"
    assert _IMPORT in scene, "scene.js as it is shipped"
    listed = re.sub(r"([\w$]+) as ([\w$]+)", r"\2:\1", names.strip().removesuffix("};"))
    scene = re.sub(r"^export ", "", scene.replace(_IMPORT, ""), flags=re.MULTILINE)
    licence = room.joinpath("three.LICENSE.txt").read_text(encoding="utf-8").strip()
    text = f"/*\n{licence}\n*/\nconst THREE=(()=>{{{body}return{{{listed}}};}})();\n{scene}"
    assert "</script" not in text
    assert "<!--" not in text
    return text
