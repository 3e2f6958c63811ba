"""What can go wrong, said so that the reader knows what to do next."""

from __future__ import annotations

__all__ = ["InvalidInput", "MissingExtra", "SoftreachError", "SoftreachWarning"]


class SoftreachError(Exception):
    """Base of every error that softreach raises on purpose."""


class InvalidInput(SoftreachError, ValueError):
    """An argument outside what is allowed.

    The message is one line: what was wrong, its value, what is allowed, what to do.

    Attributes:
        name: The argument or key that is wrong.
        value: The value that was given.
        allowed: What would have been accepted.
    """

    def __init__(self, name: str, value: object, allowed: str, hint: str = "") -> None:
        self.name, self.value, self.allowed = name, value, allowed
        message = f"{name} = {value!s}: must be {allowed}"
        super().__init__(f"{message}; {hint}" if hint else message)


class MissingExtra(SoftreachError, ImportError):
    """An optional library is needed and not installed."""

    def __init__(self, library: str, extra: str) -> None:
        super().__init__(f"this needs {library}; install it with: pip install 'softreach[{extra}]'")


class SoftreachWarning(UserWarning):
    """A result that can be used, with a limit that its reader should know."""
