"""Files that are written whole or not at all, never over what was read, and refused before the work if they cannot be.

Commands say where they will write first (`check_targets`, `check_folder`), compute, and then `write`.
"""

import os
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from hdl.errors import InputError


def check_targets(option, targets, read=(), suffixes=()):
    """Raise InputError, naming the command line's ``option``, unless `write` can write to all ``targets``.

    Parameters
    ----------
    option : str
    targets : iterable of Path
    read : iterable of Path
        Files, or folders of files, that are read: no target may be one of them.
    suffixes : sequence of str
        The ends of names that there are, with their dots; empty: any.
    """
    inputs = {os.path.realpath(file) for path in read for file in (path, *(path.iterdir() if path.is_dir() else ()))}
    for target in targets:
        if os.path.realpath(target) in inputs:
            raise InputError(option, None, target, "is one of the files that are read; choose another name")
        if os.path.isdir(target):
            raise InputError(option, None, target, "is a folder")
        if suffixes and target.suffix.lower() not in suffixes:
            raise InputError(option, None, target, f"the name must end in {_either(suffixes)}")
        if not target.name:
            raise InputError(option, None, target, "is no name of a file")
        if _is_device(target):
            if not os.access(target, os.W_OK):
                raise InputError(option, None, target, "cannot be written to")
        else:
            _check_writable(option, target, target.parent, target.name)


def check_folder(option, folder):
    """Raise InputError, naming the command line's ``option``, unless files can be written to ``folder``, which need not
    exist."""
    _check_writable(option, folder, folder, "file")


def write(contents):
    """Write {Path: str or bytes}, all of them beside their places first, so that an error leaves what was there.

    Folders that are missing are made. Raises OSError, which names the file or its folder.
    """
    data = {file: content.encode() if isinstance(content, str) else content for file, content in contents.items()}
    devices = [file for file in data if _is_device(file)]
    with ExitStack() as stack:
        beside = {}
        for folder in {file.parent for file in data if file not in devices}:
            with named(folder):
                folder.mkdir(parents=True, exist_ok=True)
                beside[folder] = Path(stack.enter_context(TemporaryDirectory(dir=folder, prefix=".writing-")))
        for file in data:
            with named(file):
                if file not in devices:
                    (beside[file.parent] / file.name).write_bytes(data[file])
        for file in data:
            with named(file):
                if file in devices:
                    file.write_bytes(data[file])
                else:
                    os.replace(beside[file.parent] / file.name, file)


def _check_writable(option, target, folder, name):
    """Try it: in ``folder`` or, where that is to be made, in what it will be made in."""
    there = next(path for path in (folder, *folder.parents) if os.path.lexists(path) or path == path.parent)
    if not os.path.isdir(there):
        raise InputError(option, None, target, f"{there} is no folder")
    wanted = folder.relative_to(there)
    try:
        with TemporaryDirectory(dir=there, prefix=".writing-") as trial:
            made = Path(trial) / wanted if ".." not in wanted.parts else Path(trial)
            made.mkdir(parents=True, exist_ok=True)
            (made / name).touch()
    except OSError as error:
        raise InputError(option, None, target, f"no file can be made in {there}: {error.strerror}") from None


def _is_device(file):
    """Whether it is a device, a pipe or the like: written to in place."""
    return os.path.exists(file) and not os.path.isfile(file)


def _either(words):
    *others, last = words
    return f"{', '.join(others)} or {last}" if others else last


@contextmanager
def named(file):
    """An OSError within it names ``file``."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from None
