"""Designs with a fault, to see that a proof would have found it."""

import importlib
import inspect
from contextlib import ExitStack, contextmanager
from types import FunctionType, ModuleType
from unittest import mock


@contextmanager
def mutant(module, old, new):
    """While this lasts, the module's functions and its classes' methods are those of its source, ``new`` for ``old``.

    Parameters
    ----------
    module : str
        Name of the module.
    old, new : str
        Source text; ``old`` occurs once, outside of ``__init__``.
    """
    sound = importlib.import_module(module)
    source = inspect.getsource(sound)
    if source.count(old) != 1:
        raise ValueError(f"{module}: {old!r} occurs {source.count(old)} times, not once")
    broken = ModuleType(module)
    exec(compile(source.replace(old, new), sound.__file__, "exec"), vars(broken))  # noqa: S102
    with ExitStack() as patches:
        for name, kind in vars(sound).items():
            if isinstance(kind, FunctionType) and kind.__module__ == module:
                patches.enter_context(mock.patch.object(sound, name, getattr(broken, name)))
            if isinstance(kind, type) and kind.__module__ == module:
                for attribute, value in vars(getattr(broken, name)).items():
                    if isinstance(value, (FunctionType, property, staticmethod)) and not attribute.startswith("__"):
                        patches.enter_context(mock.patch.object(kind, attribute, value))
        yield
