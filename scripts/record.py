"""Measurements that take long, kept with digests of the cores that they are of: whether they are current is then told
without measuring."""

import hashlib
import json
import re
import tomllib

from scripts import readme

ROOT = readme.README.parent


def digest(verilog):
    """SHA-256 of a core's Verilog, but for what its cells do not depend on.

    That is the comment above it, the names of modules and of their instances, and the values of constants: on another
    processor fits end in other last digits.
    """
    body = re.sub(r"^//.*\n", "", verilog, flags=re.MULTILINE)
    modules = re.findall(r"^module (\S+)", body, flags=re.MULTILINE)
    body = re.sub(r"^module \S+", "module", body, flags=re.MULTILINE)
    body = re.sub(r"^  (\S+)  \S+ +\($", lambda found: _instance(modules, found), body, flags=re.MULTILINE)
    return hashlib.sha256(re.sub(r"('s?[bdh])[0-9a-fA-FxzXZ_]+", r"\1", body).encode()).hexdigest()


def _instance(modules, found):
    """The line with which an instance begins, by the number of its module."""
    name = found.group(1)
    return f"  {modules.index(name)} (" if name in modules else found.group()


def title(row):
    """What core a row is of: its datapath and what is with it."""
    return row["datapath"] + (", lens" if row["lens"] else "") + (", with DSP" if row["dsp_allowed"] else "")


def pinned(*packages):
    """Versions of packages as the project asks for them: they need not be installed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *(one for extra in project["optional-dependencies"].values() for one in extra)]
    versions = dict(requirement.split("==") for requirement in wanted if "==" in requirement)
    return {package: versions[package] for package in packages}


def load(file, parts):
    """What a file holds; None where it holds no record: ``parts`` makes the README's of one."""
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
        parts(record)
        return record if {"versions", "rows"} <= record.keys() else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def stale(file, parts, versions, measured, digests, renew):
    """What is not current, in one line that ends in how to ``renew`` it; "" where all is.

    Parameters
    ----------
    file : Path
    parts : callable
        The README's parts {name: text} of a record.
    versions : dict of str to str
        Of the packages that measure, as they should be.
    measured : callable
        {core: digest} of a record; a core is named by text.
    digests : dict of str to str
        Of the cores as they are built now.
    renew : str
    """
    problem = _problem(file, parts, versions, measured, digests)
    return f"{problem}; `{renew}` brings it up to date" if problem else ""


def _problem(file, parts, versions, measured, digests):
    record = load(file, parts)
    if record is None:
        return f"{file.name} is missing, or no record of measurements"
    others = [f"{tool} {version}" for tool, version in record["versions"].items() if versions.get(tool) != version]
    if others:
        return f"{file.name} was measured with {', '.join(others)}"
    found = measured(record)
    changed = [core for core in {**digests, **found} if found.get(core) != digests.get(core)]
    if changed:
        more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        return f"{file.name} was measured on cores that are others now: {changed[0]}{more}"
    for name, text in parts(record).items():
        if readme.replaced(name, text) != readme.README.read_text(encoding="utf-8"):
            return f"{readme.README.name}: the table of {name} is not that of {file.name}"
    return ""
