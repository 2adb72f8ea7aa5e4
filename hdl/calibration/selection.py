"""What ``select`` means: which cameras, or which resolution, of a file that holds several."""

from hdl.errors import InputError


def pair(select: str, names: list[str], aliases: dict[str, str] | None = None) -> tuple[str, str]:
    """Two of ``names`` from "LEFT,RIGHT". A number stands for the name that ends in it; ``aliases`` go before.

    Raises InputError, with the names there are, for anything else.
    """
    chosen = [_named(part.strip(), names, aliases or {}) for part in select.split(",")]
    if len(chosen) != 2 or None in chosen or chosen[0] == chosen[1]:
        raise InputError("--select", None, select, f"two of {', '.join(names)} are needed, left first: LEFT,RIGHT")
    return tuple(chosen)


def one(select: str, names: list[str]) -> str:
    """One of ``names``, in either case. Raises InputError, with the names there are, for anything else."""
    for name in names:
        if name.lower() == select.strip().lower():
            return name
    raise InputError("--select", None, select, f"the choice is between {', '.join(names)}")


def _named(part, names, aliases):
    part = aliases.get(part.lower(), part)
    if part in names:
        return part
    if part.isascii() and part.isdigit() and len(part) <= 3:
        for name in names:
            digits = name.lstrip("abcdefghijklmnopqrstuvwxyz")
            if digits.isdigit() and int(digits) == int(part):
                return name
    return None
