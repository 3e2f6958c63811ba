"""What describes a store and its arrays, sealed by a digest: any change of it is noticed."""

from __future__ import annotations

import hashlib
import json
from typing import Any

__all__ = ["SEAL", "Broken", "sealed", "unsealed"]

SEAL = "metadata_sha256"
"""Attribute of every zarr.json: digest of all of it but this attribute."""

_TYPES = (
    *("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64"),
    *("float32", "float64", "string"),
)
"""Numbers and texts: nothing complex, no dates, no bytes, no objects."""
_CODECS = ("bytes", "vlen-utf8", "blosc", "zstd", "gzip", "crc32c")
"""Those of the Zarr v3 core; none of them can run code."""
_GROUP = {"zarr_format", "node_type", "attributes", "consolidated_metadata"}


class Broken(Exception):
    """What describes an array cannot be trusted, or is no array of softreach.

    Attributes:
        found: What there is.
        allowed: What there must be.
    """

    def __init__(self, found: str, allowed: str = "as softreach wrote it") -> None:
        self.found, self.allowed = found, allowed
        super().__init__(f"{found}: must be {allowed}")


def sealed(text: bytes) -> bytes:
    """The text of a zarr.json with its digest.

    Raises:
        Broken: It describes an array of a kind that no store of softreach holds.
    """
    document = _parsed(text)
    _check_kind(document)
    attributes = {key: value for key, value in _attributes(document).items() if key != SEAL}
    document["attributes"] = attributes
    document["attributes"] = {**attributes, SEAL: _digest(document)}
    return json.dumps(document, indent=2).encode()


def unsealed(text: bytes) -> dict[str, Any]:
    """What a zarr.json says, without its digest.

    Raises:
        Broken: It is not what `sealed` wrote.
    """
    document = _parsed(text)
    seal = _attributes(document).pop(SEAL, None)
    if seal is None:
        allowed = "one that softreach wrote, with checksums (older ones and others have none)"
        raise Broken("without a checksum", allowed)
    if seal != _digest(document):
        raise Broken("changed since it was written")
    _check_kind(document)
    return document


def _parsed(text: bytes) -> dict[str, Any]:
    try:
        document = json.loads(text.decode("utf-8"))
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise Broken("empty" if not text else "no JSON document")
    return document


def _attributes(document: dict[str, Any]) -> dict[str, Any]:
    attributes = document.get("attributes", {})
    if not isinstance(attributes, dict):
        raise Broken("without attributes")
    return attributes


def _digest(document: dict[str, Any]) -> str:
    text = json.dumps(document, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _check_kind(document: dict[str, Any]) -> None:
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
