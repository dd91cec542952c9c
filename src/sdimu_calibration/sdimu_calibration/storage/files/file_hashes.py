"""Which files a recording has, each with its hash: what a result was made from."""

from __future__ import annotations

import hashlib
from pathlib import Path


def file_hashes(path: Path) -> dict[Path, tuple[str, str]]:
    """Name and SHA-256 of a file, or of the files of a bag, by path."""
    files = [path] if path.is_file() else sorted(file for file in path.iterdir() if file.is_file())
    return {
        file.resolve(): (file.name if path.is_file() else f"{path.resolve().name}/{file.name}", _sha256(file))
        for file in files
    }


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
