"""A secret that a page has to know where others can reach the studio."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

__all__ = ["cookie", "is_welcome", "new_token", "with_token"]

_NAME = "softreach_token"


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(18)


def with_token(address: str, token: str) -> str:
    """An address that shows the token; the address alone without any."""
    return f"{address}/?token={token}" if token else address


def is_welcome(path: str, headers: Mapping[str, str], token: str) -> bool:
    """Whether a request shows the token: in its address, or in the cookie that it got for that.

    Args:
        path: Of the request, with its query.
        headers: Of the request.
        token: "" where none is asked for.
    """
    if not token:
        return True
    shown = [*parse_qs(urlsplit(path).query).get("token", []), *_kept(headers.get("Cookie", ""))]
    return any(hmac.compare_digest(one.encode(), token.encode()) for one in shown)


def cookie(path: str, token: str) -> str:
    """What the answer to a request sets, so that the page's own requests show the token."""
    if not token or "token" not in parse_qs(urlsplit(path).query):
        return ""
    return f"{_NAME}={token}; Path=/; HttpOnly; SameSite=Lax"


def _kept(text: str) -> list[str]:
    try:
        kept = SimpleCookie(text).get(_NAME)
    except CookieError:
        return []
    return [kept.value] if kept is not None else []
