"""Files are written whole or not at all, and what is read is not overwritten."""

import os
import threading
from pathlib import Path

import pytest

from hdl import files
from hdl.errors import InputError


def test_all_are_written_and_nothing_else_is_left(tmp_path):
    (tmp_path / "b").mkdir()
    files.write({tmp_path / "one.v": "text\n", tmp_path / "b" / "two.png": b"\x00\xff"})
    assert (tmp_path / "one.v").read_text() == "text\n" and (tmp_path / "b/two.png").read_bytes() == b"\x00\xff"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["b", "one.v", "two.png"]


def test_an_error_names_the_file_and_leaves_what_was_there(tmp_path, monkeypatch):
    (tmp_path / "one.v").write_text("before")
    whole = Path.write_bytes

    def full(self, data):
        if self.name == "two.v":
            raise OSError(28, "No space left on device")
        return whole(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError) as error:
        files.write({tmp_path / "one.v": "after", tmp_path / "two.v": "after"})
    assert (error.value.filename, error.value.strerror) == (str(tmp_path / "two.v"), "No space left on device")
    assert [path.name for path in tmp_path.iterdir()] == ["one.v"] and (tmp_path / "one.v").read_text() == "before"


def test_a_folder_that_is_missing_is_named(tmp_path):
    with pytest.raises(FileNotFoundError) as error:
        files.write({tmp_path / "no" / "one.v": ""})
    assert error.value.filename == str(tmp_path / "no")


def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()), daemon=True)
    reader.start()
    files.write({pipe: "text"})
    reader.join(timeout=10)
    assert read == [b"text"] and pipe.is_fifo()


def test_inputs_and_folders_are_no_targets(tmp_path):
    (tmp_path / "rig.yml").touch()
    (tmp_path / "link.yml").symlink_to(tmp_path / "rig.yml")
    (tmp_path / "folder").mkdir()
    for read in ([tmp_path / "rig.yml"], [tmp_path]):
        with pytest.raises(InputError, match=r"^--output: .*: is one of the files that are read; choose another name$"):
            files.refuse_overwriting("--output", [tmp_path / "new.yml", tmp_path / "link.yml"], read)
    with pytest.raises(InputError, match="^--json: .*: is a folder$"):
        files.refuse_overwriting("--json", [tmp_path / "folder"])
    files.refuse_overwriting("--output", [tmp_path / "new.yml"], [tmp_path / "rig.yml"])
