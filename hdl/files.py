"""Files that are written whole or not at all, and never over what was read."""

import os
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from hdl.errors import InputError


def refuse_overwriting(option, targets, read=()):
    """Raise InputError, naming the command line's ``option``, for a target that is a folder, or one of the files
    ``read`` or in folders that were read."""
    inputs = {os.path.realpath(file) for path in read for file in (path, *(path.iterdir() if path.is_dir() else ()))}
    for target in targets:
        if os.path.realpath(target) in inputs:
            raise InputError(option, None, target, "is one of the files that are read; choose another name")
        if os.path.isdir(target):
            raise InputError(option, None, target, "is a folder")


def write(contents):
    """Write {Path: str or bytes}, all of them beside their places first, so that an error leaves what was there.

    Raises OSError, which names the file or its folder.
    """
    with ExitStack() as stack:
        beside = {}
        for folder in {file.parent for file in contents}:
            with named(folder):
                beside[folder] = Path(stack.enter_context(TemporaryDirectory(dir=folder, prefix=".writing-")))
        for file, content in contents.items():
            with named(file):
                data = content.encode() if isinstance(content, str) else content
                (beside[file.parent] / file.name).write_bytes(data)
        for file in contents:
            with named(file):
                if file.exists() and not file.is_file():  # a device, or a pipe
                    file.write_bytes((beside[file.parent] / file.name).read_bytes())
                else:
                    os.replace(beside[file.parent] / file.name, file)


@contextmanager
def named(file):
    """An OSError within it names ``file``."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(file)) from None
