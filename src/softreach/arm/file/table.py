"""What all tables of a design file have in common."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict

__all__ = ["Table"]


class Table(BaseModel):
    """The keys of a table: aliases of the fields of what it describes.

    Required keys have an example, which stands in for a value that is wrong while the others are
    judged.
    """

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    @classmethod
    def keys(cls) -> dict[str, str]:
        """Field -> key."""
        return {name: field.alias or name for name, field in cls.model_fields.items()}

    @classmethod
    def examples(cls) -> dict[str, Any]:
        """Key -> example, for all required keys."""
        return {
            field.alias or name: (field.examples or [None])[0]
            for name, field in cls.model_fields.items()
            if field.is_required()
        }

    def values_but(self, *without: str) -> dict[str, Any]:
        """Field -> value in SI units; tables of quantities along the arm made functions."""
        fields = (name for name in type(self).model_fields if name not in without)
        given = ((name, getattr(self, name)) for name in fields)
        return {name: one.value() if isinstance(one, Table) else one for name, one in given}

    def value(self) -> Any:
        """What it stands for as the value of a key."""
        return self
