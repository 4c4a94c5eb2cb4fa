"""XML text: numbers that read back bit by bit, indented elements."""

from __future__ import annotations

from xml.etree.ElementTree import Element, indent, tostring


def numbers(*values: float) -> str:
    """Numbers separated by blanks."""
    return " ".join(repr(float(value) + 0.0) for value in values)


def xml_text(root: Element) -> str:
    """A document, indented, with its declaration."""
    indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + tostring(root, encoding="unicode") + "\n"
