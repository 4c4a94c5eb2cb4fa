"""Seals: a truth in a file whose digest is published before anything is diagnosed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from gtpin.bench.blind.truth import Truth
from gtpin.data.files import placed_file, read_bytes
from gtpin.errors import GtpinError

MANIFEST = "gtpin-blind-manifest/1"


class SealError(GtpinError):
    """The truth is missing, or its digest is not the published one."""


DIGEST = "truth.sha256"
"""File in a case's folder with the digest of its truth."""


def seal(truth: Truth, case: Path, file: Path) -> None:
    """Write the SHA-256 of a truth to the case's folder, then the truth to a file in another folder."""
    content = truth.model_dump_json().encode() + b"\n"
    (case / DIGEST).write_text(digest_of(content) + "\n", encoding="utf-8")
    with placed_file(file) as unfinished:
        unfinished.write_bytes(content)


def digest_of(content: bytes) -> str:
    """SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(content).hexdigest()


def opened(file: Path, digest: str) -> Truth:
    """Read a sealed truth.

    Raises
    ------
    SealError
        If the file is missing, or its digest is not the published one.
    """
    try:
        content = read_bytes(file)
    except GtpinError as error:
        raise SealError(error.what, file=file, hint="the case can't be scored without its truth") from None
    if digest_of(content) != digest:
        raise SealError("the seal is broken: not the digest that was published", file=file, hint="make the case anew")
    try:
        return Truth.model_validate_json(content)
    except ValidationError as error:
        raise SealError(f"no truth ({error.errors()[0]['msg']})", file=file, hint="make the case anew") from None


def write_manifest(file: Path, digests: Mapping[str, str], plant: str | None) -> str:
    """Write the digests of all truths by case name, and return the digest of the manifest itself.

    ``plant``: digest of the sources of the simulated machine; None where somebody else made the cases.
    """
    manifest = {"schema": MANIFEST, "plant": plant, "truths": dict(sorted(digests.items()))}
    content = (json.dumps(manifest, indent=1) + "\n").encode()
    with placed_file(file) as unfinished:
        unfinished.write_bytes(content)
    return digest_of(content)


def read_manifest(file: Path) -> dict[str, str]:
    """Read the digests by case name.

    Raises
    ------
    SealError
        If the file can't be read.
    """
    try:
        truths = json.loads(read_bytes(file))["truths"]
        return {str(name): str(digest) for name, digest in truths.items()}
    except (ValueError, KeyError, TypeError, AttributeError):
        raise SealError("no manifest", file=file, hint="start again in a new folder") from None
