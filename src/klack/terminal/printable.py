"""Words from files, as they may be shown on a terminal."""

__all__ = ["printable"]


def printable(text: str) -> str:
    r"""Text with its signs that steer a terminal made visible: ``\x1b`` for an escape.

    A name in a file of somebody else could otherwise clear the screen or fake an answer.
    """
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() or sign == "\n" else sign.encode("unicode_escape").decode()
        for sign in text
    )
