"""Calibration files as plain data, whatever a hostile or broken file holds.

Everything here raises InputError for what it refuses. Nothing in a file can run code, recurse without end or take
memory out of proportion to its size.
"""

import io
import json
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import yaml
from defusedxml import DefusedXmlException, ElementTree

from hdl.calibration import matfile, npzfile
from hdl.errors import InputError

MAX_BYTES = 1 << 20  # calibration files are a few kilobytes
MAX_DEPTH = 32
MAX_PARTS = 1_000
MAX_ENTRIES = 100_000  # of YAML; each takes a kilobyte while it is read

# The numbers of YAML 1.2 and of cv::FileStorage: 640, 0., 1.e-001, 1e5, .5, -.Inf, .Nan
_NUMBER = re.compile(r"[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[-+]?[0-9]+)?|\.nan|\.inf)\Z", re.IGNORECASE)


@dataclass(frozen=True)
class Document:
    """One file: ``name`` as the user gave it, and its ``text``; of MAT-files, which are not text, its ``data``, and of
    NumPy's archives the ``arrays``. ``first_line``: of a part of a file, how many lines go before it."""

    name: str
    text: str
    data: bytes = b""
    arrays: dict | None = None
    first_line: int = 0

    @classmethod
    def open(cls, path) -> "Document":
        try:
            with Path(path).open("rb") as file:
                content = file.read(MAX_BYTES + 1)
                if content.startswith(npzfile.MAGIC):
                    archive = file if len(content) > MAX_BYTES else io.BytesIO(content)
                    return cls(str(path), "", arrays=npzfile.read(str(path), archive))
        except InputError:
            raise
        except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
            raise InputError(path, None, None, f"cannot be read: {getattr(error, 'strerror', error)}") from None
        if len(content) > MAX_BYTES:
            raise InputError(path, None, None, f"larger than {MAX_BYTES >> 20} MiB, so not a calibration")
        if not content.strip():
            raise InputError(path, None, None, "the file is empty")
        if content.startswith(matfile.MAGIC):
            return cls(str(path), "", content)
        try:
            return cls(str(path), content.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            raise InputError(path, None, None, f"not text in UTF-8 (byte {error.start})") from None

    @cached_property
    def yaml(self) -> dict:
        """The content as YAML (or JSON, which is a part of it), as dict, list, int, float, str and None.

        Numbers are those of YAML 1.2 and OpenCV (``1.e-001``, ``1e5``, ``.Nan``); an ``!!opencv-matrix`` is a plain
        dict; a value need not be set off from its key by a space; a number in quotes is that number. Aliases, repeated
        keys and foreign tags are refused.
        """
        # PyYAML refuses "%YAML:1.0", which OpenCV writes. A blank line keeps the line numbers of messages.
        text = re.sub(r"\A%YAML[^\n]*", "", self.text)
        text = re.sub(r"^([ \t]*[A-Za-z_][\w.-]*):(?=[^\s:/])", r"\1: ", text, flags=re.MULTILINE)
        try:
            self._refuse_excesses(text)
            content = yaml.load(text, Loader=_Loader)
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            raise self._at(mark, " ".join(filter(None, (error.context, error.problem)))) from None
        except yaml.YAMLError as error:
            raise InputError(self.name, None, None, f"not YAML: {str(error).splitlines()[0]}") from None
        if not isinstance(content, dict):
            raise InputError(self.name, None, None, "not a calibration: there are no named fields in it")
        return content

    @cached_property
    def parts(self) -> list["Document"]:
        """Those of the file's YAML documents that are not empty: what lines of ``---`` and ``...`` part."""
        blocks, first = [], 0
        lines = self.text.splitlines()
        for number, line in enumerate([*lines, "..."]):
            if line.rstrip() in ("---", "..."):
                blocks.append((first, "\n".join(lines[first:number])))
                first = number + 1
        blocks = [block for block in blocks if block[1].strip()]
        if len(blocks) > MAX_PARTS:
            raise InputError(self.name, None, None, f"more than {MAX_PARTS} YAML documents in one file")
        return [Document(self.name, text, first_line=first) for first, text in blocks]

    @cached_property
    def xml(self) -> dict:
        """The content as the XML that cv::FileStorage writes, in the same form as :attr:`yaml`."""
        try:
            root = ElementTree.fromstring(self.text, forbid_dtd=True)
        except ElementTree.ParseError as error:
            problem = str(error).split(":")[0]  # the rest repeats the position
            raise InputError(self.name, f"line {error.position[0]}", None, f"not XML: {problem}") from None
        except DefusedXmlException:
            raise InputError(self.name, None, None, "XML with a document type or entities is refused") from None
        except (ValueError, LookupError) as error:
            raise InputError(self.name, None, None, f"not XML: {error}") from None
        return self._children(root, 1)

    @cached_property
    def json(self) -> dict:
        """The content as JSON, in the same form as :attr:`yaml`. Repeated keys are refused."""

        def mapping(pairs):
            content = dict(pairs)
            if len(content) < len(pairs):
                keys = [key for key, _ in pairs]
                repeated = next(key for key in content if keys.count(key) > 1)
                raise InputError(self.name, repeated, None, "given twice")
            return content

        try:
            content = json.loads(
                self.text, object_pairs_hook=mapping, parse_int=scalar, parse_float=scalar, parse_constant=str
            )
        except json.JSONDecodeError as error:
            raise InputError(self.name, f"line {error.lineno}", None, f"not JSON: {error.msg}") from None
        except RecursionError:
            raise InputError(self.name, None, None, f"nested more than {MAX_DEPTH} deep") from None
        if not isinstance(content, dict):
            raise InputError(self.name, None, None, "not a calibration: there are no named fields in it")
        level = [content]
        for _ in range(MAX_DEPTH):
            level = [item for group in level for item in (group.values() if isinstance(group, dict) else group)]
            level = [item for item in level if isinstance(item, (dict, list))]
        if level:
            raise InputError(self.name, None, None, f"nested more than {MAX_DEPTH} deep")
        return content

    @cached_property
    def mat(self) -> matfile.Contents:
        """The variables of a MAT-file."""
        return matfile.read(self.name, self.data)

    def _children(self, element, depth) -> dict:
        if depth > MAX_DEPTH:
            raise InputError(self.name, element.tag, None, f"nested more than {MAX_DEPTH} deep")
        content = {}
        for child in element:
            if child.tag in content and child.tag != "_":  # "_" marks the items of a sequence
                raise InputError(self.name, child.tag, None, "given twice")
            content[child.tag] = self._children(child, depth + 1) if len(child) else _xml_value(child)
        return content

    def _refuse_excesses(self, text):
        depth = 0
        for number, event in enumerate(yaml.parse(text, Loader=_Loader)):
            if number > MAX_ENTRIES:
                raise self._at(event.start_mark, f"more than {MAX_ENTRIES} entries")
            if isinstance(event, yaml.AliasEvent):
                raise self._at(event.start_mark, "aliases are refused")
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            if depth > MAX_DEPTH:
                raise self._at(event.start_mark, f"nested more than {MAX_DEPTH} deep")

    def _at(self, mark, problem):
        return InputError(self.name, mark and f"line {self.first_line + mark.line + 1}", None, problem)


def scalar(text: str) -> int | float | str:
    """The value of a word: a number where it spells one, otherwise the word itself."""
    if not _NUMBER.match(text):
        return text
    if text.lstrip("+-").isdigit() and len(text) < 20:
        return int(text)
    return float(text.lower().replace(".nan", "nan").replace(".inf", "inf"))


def _xml_value(element):
    text = (element.text or "").strip()
    if text.startswith('"'):
        return scalar(text.strip('"'))
    words = [scalar(word) for word in text.split()]
    return words[0] if len(words) == 1 else words


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """YAML as plain data and nothing else: no dates, no numbers of base 8 or 60, no objects."""

    yaml_implicit_resolvers = {}
    yaml_constructors = {}
    yaml_multi_constructors = {}

    def construct_mapping(self, node, deep=False):
        seen = set()
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if isinstance(key, yaml.ScalarNode) and key.value in seen:
                raise _refusal(f"{key.value!r} is given twice", key)
            seen.add(key.value if isinstance(key, yaml.ScalarNode) else None)
        return super().construct_mapping(node, deep)

    def construct_number(self, node):
        value = scalar(self.construct_scalar(node))
        if isinstance(value, str):
            raise _refusal(f"{value!r} is not a number", node)
        return value

    def construct_text(self, node):
        return scalar(self.construct_scalar(node))

    def construct_opencv(self, suffix, node):
        return self.construct_mapping(node, deep=True)


def _refusal(problem, node):
    return yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


def _tag(name):
    return f"tag:yaml.org,2002:{name}"


_Loader.add_implicit_resolver(_tag("float"), _NUMBER, list("-+.0123456789"))
_Loader.add_implicit_resolver(_tag("null"), re.compile(r"(?:~|null|)\Z"), ["~", "n", ""])
_Loader.add_constructor(_tag("float"), _Loader.construct_number)
_Loader.add_constructor(_tag("int"), _Loader.construct_number)
_Loader.add_constructor(_tag("null"), lambda loader, node: None)
_Loader.add_constructor(_tag("str"), _Loader.construct_text)
_Loader.add_constructor(_tag("seq"), _Loader.construct_yaml_seq)
_Loader.add_constructor(_tag("map"), _Loader.construct_yaml_map)
_Loader.add_constructor(None, _Loader.construct_undefined)
_Loader.add_multi_constructor(_tag("opencv-"), _Loader.construct_opencv)
