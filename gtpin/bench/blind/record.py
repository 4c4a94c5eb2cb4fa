"""What a check remembers of its own files: the digests that they had first, so that a later run reports what was changed.

The record is in ``check.json``. It shows edits of truths (also together with their digests and the manifest), of datasets and
of diagnoses. Whoever also edits the record leaves no trace in the folder: the digest of the manifest that is printed when the
truths are sealed is the proof for others.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

from gtpin.bench.blind.seal import digest_of
from gtpin.data.files import placed_file

KEY = "digests"
"""The key of ``check.json`` that holds the digests, by kind of file and name."""


def compared(claim: Path, kind: str, digests: Mapping[str, str]) -> list[str]:
    """Compare digests with those that were remembered first, and remember those of new names.

    Parameters
    ----------
    claim
        The ``check.json`` of the check.
    kind
        What the files are, for messages: ``truth``, ``dataset``, ``diagnosis``.
    digests
        SHA-256 of each file, by the case's name.

    Returns
    -------
    changed
        ``KIND of NAME`` for each file whose digest is another one, or that was remembered and is not there.
    """
    content = json.loads(claim.read_text(encoding="utf-8"))
    known: dict[str, str] = content.setdefault(KEY, {}).setdefault(kind, {})
    new = {name: digest for name, digest in digests.items() if name not in known}
    changed = [f"{kind} of {name}" for name, digest in digests.items() if known.get(name, digest) != digest]
    changed += [f"{kind} of {name}" for name in known if name not in digests]
    if new:
        known.update(new)
        with placed_file(claim) as unfinished:
            unfinished.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return changed


def digest_of_files(files: Mapping[str, bytes]) -> str:
    """SHA-256 of several files with their names."""
    found = hashlib.sha256()
    for name, content in sorted(files.items()):
        found.update(name.encode() + b"\0" + digest_of(content).encode() + b"\0")
    return found.hexdigest()
