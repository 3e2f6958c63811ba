"""Descriptions of a store and its arrays: sealed, listed in the root, and of a known kind.

The root lists the digest of what describes each array, and ends with its own.
"""

from __future__ import annotations

import hashlib
import json
from typing import Any

from softreach.support.files.damage import AS_WRITTEN, Chunk, Watch

ARRAYS = "arrays"
"""Attribute of the root: digest of what describes each array, by its name."""
CHUNKS = "chunks"
"""Attribute of the root or an array: checksum of each chunk that is written once, by its key."""
DIGEST = "sha256"
"""Attribute of the root: digest of all of it but this attribute."""

_TYPES = (
    *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64", "string"),
)
"""Numbers and texts: nothing complex, no dates, no bytes, no objects."""
_CODECS = ("bytes", "vlen-utf8", "blosc", "zstd", "gzip", "crc32c")
"""Those of the Zarr v3 core; none of them can run code."""
_GROUP = {"zarr_format", "node_type", "attributes", "consolidated_metadata"}


class Broken(Exception):
    """A file that cannot be trusted, or is none of softreach: what it is, and what it must be."""

    def __init__(self, found: str, allowed: str = AS_WRITTEN) -> None:
        self.found, self.allowed = found, allowed
        super().__init__(f"{found}: must be {allowed}")


def sealed(text: bytes) -> bytes:
    """The text of a root with its digest."""
    document = parsed(text)
    attributes = {key: value for key, value in document["attributes"].items() if key != DIGEST}
    document["attributes"] = attributes
    document["attributes"] = {**attributes, DIGEST: digest_of(document)}
    return json.dumps(document, indent=2).encode()


def unsealed(text: bytes) -> dict[str, Any]:
    """Description in a root, without its digest."""
    document = parsed(text)
    digest = document["attributes"].pop(DIGEST, None)
    if digest is None:
        allowed = "one that softreach wrote, with checksums (older ones and others have none)"
        raise Broken("without a checksum", allowed)
    if digest != digest_of(document):
        raise Broken("changed since it was written")
    check_kind(document)
    return document


def parsed(text: bytes) -> dict[str, Any]:
    """A text as a document with attributes."""
    try:
        document = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise Broken("empty" if not text else "no JSON document")
    if not isinstance(document.setdefault("attributes", {}), dict):
        raise Broken("without attributes")
    return document


def described(watch: Watch, chunk: Chunk, text: bytes) -> dict[str, Any]:
    """Description of an array, as its store lists it."""
    document = parsed(text)
    if chunk.array not in watch.digests:
        allowed = "one of those that softreach wrote, or moved away"
        raise Broken("not listed in the root", allowed)
    if digest_of(document) != watch.digests[chunk.array]:
        raise Broken("changed since it was written")
    check_kind(document)
    return document


def digest_of(document: dict[str, Any]) -> str:
    """SHA-256 of a document, however it is laid out."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def check_kind(document: dict[str, Any]) -> None:
    """Check that it is a group, or an array of a kind that softreach writes."""
    if document.get("node_type") != "array":
        if not _GROUP.issuperset(document):
            raise Broken("of neither a group nor an array")
        return
    if document.get("data_type") not in _TYPES:
        shown = json.dumps(document.get("data_type"))
        raise Broken(f"of type {shown}", "of numbers or of texts")
    codecs = [codec.get("name") for codec in document.get("codecs", [])]
    if not set(codecs) <= set(_CODECS) or codecs[-1:] != ["crc32c"]:
        allowed = f"some of {', '.join(_CODECS)}, the last of them crc32c"
        raise Broken(f"with the codecs {', '.join(map(str, codecs))}", allowed)
