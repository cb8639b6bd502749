"""The folder that models are written into."""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from klack.errors import refuse_if
from klack.exchange.modal_model import ModalModel
from klack.exchange.results.table import identifiers
from klack.files.whole import whole_files

__all__ = ["LONGEST", "model_folder", "named_apart"]

LONGEST = 55
"""Characters of a model name; MATLAB allows 63 for a file."""


@contextmanager
def model_folder(models: Sequence[ModalModel], folder: Path) -> Iterator[Path]:
    """Place for the files of these models, which move into ``folder`` when all are complete.

    Rejects equal names (in any case, as file systems do), names too long, and models without
    modes.

    Parameters
    ----------
    folder
        Made where missing; files of the same name are replaced.
    """
    for name, count in Counter(model.name.lower() for model in models).items():
        refuse_if(
            count > 1,
            str(folder),
            got=f"{count} models with the name '{name}'",
            expected="distinct names",
            hint="rename a body of the case.",
        )
    for model in models:
        refuse_if(
            len(model.name) > LONGEST,
            str(folder),
            got=f"the model name '{model.name}' of {len(model.name)} characters",
            expected=f"at most {LONGEST}, for MATLAB to accept it with a suffix",
            hint="give the case or the body a shorter name.",
        )
        refuse_if(
            model.mode_count == 0,
            f"model '{model.name}'",
            got="no modes",
            expected="a body that can move",
            hint="a rigid wall needs no model: leave it out.",
        )
    with whole_files(folder) as stage:
        yield stage


def named_apart(model: ModalModel) -> ModalModel:
    """Model with numbers appended to repeated names.

    ``tip-a`` and ``tip_a`` are one name in most programs.
    """
    inputs = identifiers([item.name for item in model.inputs])
    outputs = identifiers([output.name for output in model.outputs], inputs)
    contacts = identifiers([contact.name for contact in model.contacts])
    return replace(
        model,
        inputs=tuple(replace(a, name=n) for a, n in zip(model.inputs, inputs, strict=True)),
        outputs=tuple(replace(a, name=n) for a, n in zip(model.outputs, outputs, strict=True)),
        contacts=tuple(replace(a, name=n) for a, n in zip(model.contacts, contacts, strict=True)),
    )
