"""Fields and properties of a class as one table of the reference: an extension of griffe.

Inherited fields are in it, because an arm is made of them. Methods follow the table.
"""

from __future__ import annotations

from collections.abc import Iterator

import griffe

_COMPUTED = {"lazy", "cached_property"}  # decorators of properties


class Tables(griffe.Extension):
    """Adds the table to each class, in place of a heading for each field."""

    def on_package(self, *, pkg: griffe.Module, **_: object) -> None:
        """Visit the classes of the package once all of it is known."""
        for cls in classes_in(pkg):
            rows = {row.name: row for row in rows_of(cls)}
            if cls.docstring and rows:
                sections = cls.docstring.parsed
                others = [part for part in sections if part.kind.value != "attributes"]
                first = 1 if others and others[0].kind.value == "text" else 0
                table = griffe.DocstringSectionAttributes([*rows.values()])
                sections[:] = [*others[:first], table, *others[first:]]
            for name, member in cls.members.items():
                if name in rows or name.startswith("_"):
                    member.public = False  # it has no heading of its own


def classes_in(module: griffe.Module) -> Iterator[griffe.Class]:
    """Classes of a module and of the modules in it."""
    for member in module.members.values():
        if isinstance(member, griffe.Class):
            yield member
        elif isinstance(member, griffe.Module):
            yield from classes_in(member)


def rows_of(cls: griffe.Class) -> Iterator[griffe.DocstringAttribute]:
    """Fields of a class and its bases, then what the class computes, each with its meaning."""
    bases = [base for base in reversed(cls.mro()) if base.path.startswith("softreach.")]
    members = [m for base in (*bases, cls) for m in base.members.values() if _is_row(m, cls)]
    told = {row.name: str(row.description) for row in _told(cls)}
    for member in sorted({m.name: m for m in members}.values(), key=_is_computed):
        text = member.docstring.value if member.docstring else told.pop(member.name, "")
        yield _row(cls, member, text)
    for name, text in told.items():
        yield griffe.DocstringAttribute(name, description=text)


def _told(cls: griffe.Class) -> list[griffe.DocstringAttribute]:
    parsed = cls.docstring.parse("google") if cls.docstring else []
    return [row for part in parsed if part.kind.value == "attributes" for row in part.value]


def _is_row(member: griffe.Object | griffe.Alias, cls: griffe.Class) -> bool:
    """A field of the class or a base of it, and what else the class itself explains."""
    if (
        member.is_alias
        or member.name.startswith("_")
        or not (member.is_attribute or _is_computed(member))
    ):
        return False
    is_field = not _is_computed(member) and "instance-attribute" in member.labels
    return is_field or (member.parent is cls and (bool(member.docstring) or _is_enum(cls)))


def _row(cls: griffe.Class, member: griffe.Object, text: str) -> griffe.DocstringAttribute:
    kind = member.returns if isinstance(member, griffe.Function) else member.annotation
    default = _default_of(cls, member.value) if isinstance(member, griffe.Attribute) else ""
    if _is_enum(cls):
        text, default = text or default.strip("\"'"), ""
    is_said = default and {"class-attribute", "instance-attribute"} <= member.labels
    said = f"{text} Default: `{default}`." if is_said else text
    return griffe.DocstringAttribute(member.name, annotation=kind, description=said)


def _default_of(cls: griffe.Class, value: str | griffe.Expr | None) -> str:
    if isinstance(value, griffe.ExprCall) and str(value.function) in ("number", "field"):
        named = {each.name: each.value for each in value.arguments if hasattr(each, "name")}
        made = named.get("default_factory")
        return _default_of(cls, named.get("default")) or (f"{made}()" if made else "")
    constant = cls.module.members.get(str(value))  # such as `_ZERO`
    return str(constant.value if isinstance(constant, griffe.Attribute) else value or "")


def _is_enum(cls: griffe.Class) -> bool:
    return any("Enum" in str(base) for base in cls.bases)


def _is_computed(member: griffe.Object | griffe.Alias) -> bool:
    if isinstance(member, griffe.Function):
        return any(str(d.value).rpartition(".")[2] in _COMPUTED for d in member.decorators)
    return "property" in member.labels
