"""Numbers and documents as XML text."""

from __future__ import annotations

from xml.etree.ElementTree import Element, indent, tostring


def numbers(*values: float) -> str:
    """Numbers separated by blanks, with as many digits as needed to read back the same values; -0.0 becomes 0.0."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def xml_text(root: Element) -> str:
    """A document, indented, with its declaration."""
    indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="unicode") + "\n"
