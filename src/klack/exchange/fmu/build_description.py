"""``sources/buildDescription.xml`` of an FMU of version 3: how to compile its C sources."""

from xml.etree import ElementTree as ET

from klack.exchange.fmu.model_description import SOURCE_FILES
from klack.exchange.modal_model import ModalModel

__all__ = ["build_description"]


def build_description(model: ModalModel) -> str:
    """XML text; one configuration that every C99 compiler can build, on every platform."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in SOURCE_FILES[3]:
        ET.SubElement(files, "SourceFile", name=name)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, "unicode") + "\n"
