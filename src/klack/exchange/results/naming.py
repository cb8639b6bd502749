"""Names and texts as other formats allow them, names each one different."""

from collections.abc import Collection, Sequence

from klack.exchange.modal_model import identifier

__all__ = ["file_stems", "identifiers", "octave_text"]

LONGEST = 63
"""Characters of a name in MATLAB."""


def identifiers(names: Sequence[str], taken: Collection[str] = ()) -> tuple[str, ...]:
    """Letters, digits and underscores, no digit first, at most 63 characters, no two the same.

    Parameters
    ----------
    names : sequence of str
    taken : collection of str
        Names that are used already.

    Examples
    --------
    >>> identifiers(["needle.tip force", "needle tip force", "2 x"])
    ('needle_tip_force', 'needle_tip_force_2', 'm_2_x')
    """
    return _distinct([identifier(name) for name in names], taken)


def file_stems(names: Sequence[str]) -> tuple[str, ...]:
    """Names of files without their suffix: no folder, no hidden file, no two the same.

    Examples
    --------
    >>> file_stems(["reduced-none", "../wet"])
    ('reduced-none', '___wet')
    """
    plain = ["".join(c if c.isalnum() or c in "_-" else "_" for c in name) for name in names]
    return _distinct([name or "run" for name in plain], ())


def octave_text(words: str) -> str:
    """Text with a blank for each further byte of its letters.

    scipy counts letters where Octave reads bytes: without them the end of "Stäbe" is lost.
    """
    return words + " " * (len(words.encode()) - len(words))


def _distinct(names: Sequence[str], taken: Collection[str]) -> tuple[str, ...]:
    # file systems and some tools do not tell upper from lower case
    used = {name.lower() for name in taken}
    out = []
    for name in names:
        free, number = name[:LONGEST], 1
        while free.lower() in used:
            number += 1
            end = f"_{number}"
            free = name[: LONGEST - len(end)] + end
        used.add(free.lower())
        out.append(free)
    return tuple(out)
