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


def test_folders_that_are_missing_are_made(tmp_path):
    files.write({tmp_path / "no" / "such" / "one.v": "text"})
    assert (tmp_path / "no/such/one.v").read_text() == "text"


def test_a_file_where_a_folder_should_be_is_named(tmp_path):
    (tmp_path / "no").write_text("")
    with pytest.raises(OSError) as error:
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
            files.check_targets("--output", [tmp_path / "new.yml", tmp_path / "link.yml"], read)
    with pytest.raises(InputError, match="^--json: .*: is a folder$"):
        files.check_targets("--json", [tmp_path / "folder"])
    files.check_targets("--output", [tmp_path / "new.yml"], [tmp_path / "rig.yml"])


@pytest.mark.parametrize(
    "folder, name, problem",
    [
        ("rig.yml", "out.v", "rig.yml is no folder"),
        ("rig.yml/deep", "out.v", "rig.yml is no folder"),
        ("gone.yml", "out.v", "gone.yml is no folder"),
        ("/proc", "out.v", "no file can be made in /proc: No such file or directory"),
        ("/proc/new", "out.v", "no file can be made in /proc: No such file or directory"),
        ("a" * 300, "out.v", "no file can be made in .: File name too long"),
        ("new", "a" * 300, "no file can be made in .: File name too long"),
    ],
)
def test_targets_that_cannot_be_written_are_refused_and_nothing_is_made(folder, name, problem, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("rig.yml").touch()
    Path("gone.yml").symlink_to("nothing")
    with pytest.raises(InputError) as error:
        files.check_targets("--output", [Path(folder, name)])
    assert str(error.value).startswith("--output: ") and str(error.value).endswith(f": {problem}")
    if len(name) < 99:
        with pytest.raises(InputError) as error:
            files.check_folder("--output", Path(folder))
        assert str(error.value).endswith(f": {problem}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["gone.yml", "rig.yml"]


def test_targets_that_can_be_written_are_taken_and_nothing_is_made(tmp_path):
    (tmp_path / "old.v").write_text("kept")
    os.mkfifo(tmp_path / "pipe")
    targets = [tmp_path / name for name in ("old.v", "pipe", "new.v", "a/b/new.v", "a/../c/new.v")]
    files.check_targets("--output", [*targets, Path("/dev/null"), Path("here.v")])
    files.check_folder("--output", tmp_path / "x" / "y")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["old.v", "pipe"]
    assert (tmp_path / "old.v").read_text() == "kept"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_folders_without_permission_are_refused(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o555)
    with pytest.raises(InputError, match="no file can be made in .*closed: Permission denied$"):
        files.check_folder("--output", tmp_path / "closed" / "new")


def test_a_name_without_the_right_end_is_refused(tmp_path):
    files.check_targets("--plot", [tmp_path / "x.SVG"], suffixes=(".svg", ".png"))
    with pytest.raises(InputError, match=r"^--plot: .*x\.foo: the name must end in \.svg or \.png$"):
        files.check_targets("--plot", [tmp_path / "x.foo"], suffixes=(".svg", ".png"))
