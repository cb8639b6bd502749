"""Colours of code blocks with names of our own."""

from pygments.lexers import BashLexer, TextLexer, YamlLexer
from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]


def setup(app: Sphinx) -> ExtensionMetadata:
    """``yaml-part`` is no whole case, ``sh-fails`` is to fail, ``csv`` has no colours."""
    app.add_lexer("sh-fails", BashLexer)
    app.add_lexer("csv", TextLexer)
    app.add_lexer("yaml-part", YamlLexer)
    return {"parallel_read_safe": True}
