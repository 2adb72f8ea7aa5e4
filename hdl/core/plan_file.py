"""Plans read back from a folder that `hdl.generate` wrote, and the cores that they state, rebuilt."""

import codecs
import hashlib
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from hdl.calibration.rig import SIDES, Camera, Rig
from hdl.calibration.stance import ALIGNED
from hdl.cli import GREATEST_SIZE, LEAST_SIZE
from hdl.core.build import MARK, Options, build
from hdl.core.plan import PLAN_VERSION, Plan
from hdl.core.versions import elsewhere
from hdl.datapaths import DATAPATHS
from hdl.datapaths.base import fitted_budget
from hdl.errors import InputError
from hdl.geometry.coordinates import Border
from hdl.geometry.view import View
from hdl.lens import LENS_MODELS
from hdl.tools.verilog_keywords import is_identifier

# Plans written on another machine may have sums in another order.
_SAME = 1e-9


@dataclass(frozen=True)
class PlannedCore:
    """A core as it lies in a folder.

    Members
    -------
    file : Path
        The plan.
    plan : Plan
    verilog : str
        The text beside the plan; its SHA-256 is the plan's. Lines end in LF here, whatever they end in there.
    """

    file: Path
    plan: Plan
    verilog: str

    @property
    def files(self):
        """The plan and the Verilog."""
        return self.file, self.file.with_suffix(".v")

    @property
    def view(self):
        """The `View` that the plan states."""
        return view_of(self.plan)

    def rebuild(self, progress=lambda step: None):
        """The `Core` that the plan states: the same Verilog, and everything else in the plan the same.

        What led to it is kept as it is: ``considered``, of which only the choice is checked, ``minimised`` and the
        clock that cores like it reached.

        Raises
        ------
        InputError
            Where it is not the same: the plan was changed by hand, or by another version of the generator.
        """
        plan = self.plan
        # A choice among datapaths has one budget for all of them; one chosen by name has its own default.
        budget = plan.max_error_requested
        if plan.considered and budget is None:
            budget = fitted_budget(plan.fraction_bits)
        try:
            options = _options(plan, budget)
            core = build(self.view, options, plan.top, progress)
        except (InputError, ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            problem = f"cannot be rebuilt{elsewhere(plan.versions)}: {error}"
            raise InputError(self.file, "datapath", plan.datapath, problem) from error
        found, stated = core.plan.model_dump(), plan.model_dump()
        for name in ("considered", "max_error_requested", "versions", "verilog_sha256", "plan_sha256"):
            found[name] = stated[name]
        found["pipeline"] |= {name: stated["pipeline"][name] for name in ("mhz", "basis")}
        found["rectification"]["minimised"] = stated["rectification"]["minimised"]
        difference = _difference(found, stated)
        if difference:
            field, value, rebuilt = difference
            problem = f"rebuilding the core gives {_short(rebuilt)}{elsewhere(plan.versions)}; generate it anew"
            raise InputError(self.file, field, value, problem)
        if core.verilog != self.verilog:
            problem = f"rebuilding the core gives another Verilog{elsewhere(plan.versions)}; generate it anew"
            raise InputError(self.file, "verilog_sha256", plan.verilog_sha256, problem)
        if plan.digest() != plan.plan_sha256:
            raise InputError(self.file, "plan_sha256", plan.plan_sha256, "the plan was changed; generate it anew")
        return replace(core, plan=plan)


def view_of(plan):
    """The `View` that a `Plan` states."""
    size = plan.source.width, plan.source.height
    return View(
        plan.camera.side,
        Camera(plan.camera.model, np.array(plan.camera.K), np.array(plan.camera.D), size=size),
        np.array(plan.rectification.R),
        np.array(plan.rectification.P),
        plan.width,
        plan.height,
        plan.lens,
        aligned=plan.rectification.aligned,
        origin=plan.rectification.origin,
        entry=plan.camera.source,
        unit=plan.rectification.unit,
    )


def load(file):
    """The `Plan` in a file. Raises InputError where it cannot be read, and for a field that is missing or none."""
    file = Path(file)
    try:
        plan = Plan.model_validate_json(_text(file))
    except OSError as error:
        raise InputError(file, None, None, f"cannot be read: {error.strerror}") from error
    except ValidationError as errors:
        raise _refusal(file, errors.errors()[0]) from None
    _check(file, plan)
    return plan


def load_folder(folder):
    """The cores in a folder, {side: `PlannedCore`}, left first: every TOP.v with the TOP.json beside it.

    Files that are neither a core's Verilog nor a plan are passed over.

    Raises
    ------
    InputError
        For a folder without cores, a plan without its Verilog or the other way round, a plan that is none or that
        belongs to another Verilog, two cores of one camera, and two cameras that are no pair.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(folder, None, None, "is no folder" if folder.exists() else "there is no such folder")
    cores = {}
    for file in sorted({path.with_suffix(".json") for path in folder.iterdir() if _belongs(path)}):
        core = _load_core(file)
        side = core.plan.camera.side
        if side in cores:
            problem = f"{cores[side].file.name} is of the {side} camera too; keep one of them in the folder"
            raise InputError(file, "camera.side", side, problem)
        cores[side] = core
    if not cores:
        raise InputError(
            folder, None, None, "has no core: no TOP.v with its TOP.json; python -m hdl.generate writes them"
        )
    if len(cores) == 2:
        _check_pair(*(cores[side] for side in SIDES))
    return {side: cores[side] for side in SIDES if side in cores}


def stereo_rig(cores):
    """The `Rig` that the plans' rectifications imply, in the calibration's unit.

    A single camera gets a second one like it, a baseline of 1 beside it, or below it, where its P has none.
    """
    views = {side: core.view for side, core in cores.items()}
    (only, view), *others = views.items()
    if not others:
        shift, axis = np.zeros(3), axis_of(view)
        shift[axis] = view.P[axis, 3] / view.P[axis, axis] or -1.0
        return Rig(str(only), view.width, view.height, view.camera, view.camera, np.eye(3), view.R.T @ shift)
    left, right = views["left"], views["right"]
    baseline = np.zeros(3)
    baseline[axis_of(left)] = -baseline_of(left, right)
    # R_right x_right = R_left x_left + (-B, 0, 0), or (0, -B, 0)
    R, T = right.R.T @ left.R, right.R.T @ baseline
    source = ", ".join(str(core.file) for core in cores.values())
    return Rig(source, left.width, left.height, left.camera, right.camera, R, T)


def baseline_of(left, right):
    """Distance between the two cameras, in the calibration's unit, from the P of both `View`s."""
    axis = axis_of(left)
    return left.P[axis, 3] / left.P[axis, axis] - right.P[axis, 3] / right.P[axis, axis]


def axis_of(view):
    """0 or 1: the axis along which points of the pair are apart, x where rows are aligned."""
    return ALIGNED.index(view.aligned)


def _options(plan, budget=None):
    """What was asked for, as far as it decides the core."""
    return Options(
        datapath=plan.datapath,
        max_error=budget,
        pixel_bits=plan.pixel_bits,
        channels=plan.channels,
        fraction_bits=plan.fraction_bits,
        border=Border(plan.border.mode, plan.border.value),
        max_line_buffer_kib=2**40,
        dsp=plan.dsp,
        pipeline=plan.pipeline.name,
        optimise=plan.optimise,
    )


def _check(file, plan):
    """Refuse what no generator writes, before anything is computed from it."""
    for field in ("width", "height"):
        value = getattr(plan, field)
        if not LEAST_SIZE <= value <= GREATEST_SIZE:
            raise InputError(file, field, value, f"must be {LEAST_SIZE} to {GREATEST_SIZE}")
    if not 3 <= plan.fraction_bits <= 8:
        raise InputError(file, "fraction_bits", plan.fraction_bits, "must be 3 to 8")
    if not is_identifier(plan.top):
        raise InputError(file, "top", plan.top, "is no Verilog identifier")
    lens = LENS_MODELS.get(plan.camera.model)
    if lens is None:
        raise InputError(file, "camera.model", plan.camera.model, f"is none of {', '.join(LENS_MODELS)}")
    if found := lens.refusal(plan.camera.D):
        raise InputError(file, "camera.D", *found)
    if plan.datapath not in DATAPATHS:
        raise InputError(file, "datapath", plan.datapath, f"is none of {', '.join(DATAPATHS)}")
    try:
        _options(plan)
    except InputError as refusal:
        raise InputError(file, None, None, str(refusal)) from None
    chosen = [entry for entry in plan.considered if entry.verdict == "chosen"]
    if plan.considered and [entry.datapath for entry in chosen] != [plan.datapath]:
        names = ", ".join(entry.datapath for entry in chosen) or "none"
        raise InputError(file, "considered", names, f"the chosen datapath must be {plan.datapath}")
    for axis in range(2):
        focal = plan.rectification.P[axis][axis]
        if not focal > 0:
            field = f"rectification.P[{axis}][{axis}]"
            raise InputError(file, field, focal, "must be a positive focal length")
    for matrix, field in ((plan.camera.K, "camera.K"), (plan.rectification.R, "rectification.R")):
        if abs(np.linalg.det(matrix)) < 1e-9:
            raise InputError(file, field, matrix, "is singular")


def _belongs(path):
    """Whether a file is a core's Verilog or a plan, or should be."""
    if not path.is_file():
        return False
    if path.suffix == ".v":
        with path.open(encoding="utf-8", errors="replace") as text:
            return MARK in text.readline(200) or path.with_suffix(".json").exists()
    if path.suffix != ".json":
        return False
    if path.with_suffix(".v").exists():
        return True
    try:
        content = json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return False
    return isinstance(content, dict) and ("plan_version" in content or "verilog_sha256" in content)


def _load_core(file):
    verilog_file = file.with_suffix(".v")
    if not file.exists():
        raise InputError(verilog_file, None, None, f"its plan, {file.name}, is missing")
    plan = load(file)
    if not verilog_file.exists():
        raise InputError(file, "top", plan.top, f"its Verilog, {verilog_file.name}, is missing")
    data = _text(verilog_file)
    found = hashlib.sha256(data).hexdigest()
    if found != plan.verilog_sha256:
        problem = f"{verilog_file.name} has {found[:12]}...: the plan or the Verilog was changed; generate both anew"
        raise InputError(file, "verilog_sha256", plan.verilog_sha256, problem)
    try:
        return PlannedCore(file, plan, data.decode())
    except UnicodeDecodeError:
        raise InputError(verilog_file, None, None, "is not the text of a core") from None


def _text(file):
    """The bytes of a text file as they were before a mark was put before them and the ends of lines became CRLF, as
    Windows programs and git do."""
    return file.read_bytes().removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n")


def _check_pair(left, right):
    aligned = [core.plan.rectification.aligned for core in (left, right)]
    if aligned[0] != aligned[1]:
        problem = f"{left.file.name} has {aligned[0]}: these two are no pair"
        raise InputError(right.file, "rectification.aligned", aligned[1], problem)
    axis = axis_of(left.view)
    for field, index in (
        *((name, None) for name in ("width", "height", "lens", "pixel_bits", "channels", "fraction_bits", "dsp")),
        *((f"rectification.P[{row}][{column}]", (row, column)) for row, column in ((0, 0), (1, 1), (1 - axis, 2))),
    ):
        values = [getattr(core.plan, field) if index is None else core.view.P[index] for core in (left, right)]
        if not math.isclose(*values, rel_tol=1e-6):
            problem = f"{left.file.name} has {values[0]}: these two are no pair"
            raise InputError(right.file, field, values[1], problem)
    if left.plan.top == right.plan.top:
        raise InputError(right.file, "top", right.plan.top, f"{left.file.name} has the same; use another --top for one")
    baseline = baseline_of(left.view, right.view)
    if not baseline > 0:
        problem = f"gives a baseline of {baseline:.4g}: the left and the right camera are exchanged, or the same"
        raise InputError(right.file, f"rectification.P[{axis}][3]", right.view.P[axis, 3], problem)


def _refusal(file, error):
    """What pydantic found first, as an InputError."""
    field = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".") or None
    kind, value = error["type"], error.get("input")
    if kind == "json_invalid":
        return InputError(file, None, None, f"is not JSON: {error['ctx']['error']}")
    if field == "plan_version":
        return InputError(file, field, value, f"plans of version {PLAN_VERSION} can be read; generate it anew")
    if kind == "missing":
        return InputError(file, field, None, "is missing")
    if kind == "extra_forbidden":
        return InputError(file, field, value, f"is no field of a plan of version {PLAN_VERSION}")
    if field is None:
        return InputError(file, None, value, "is no plan: not a JSON object")
    message = error["msg"]
    return InputError(file, field, value, message[:1].lower() + message[1:])


def _difference(found, stated, field=""):
    """The first field that differs, as (field, stated, found); None if there is none."""
    if isinstance(found, dict) and isinstance(stated, dict):
        for name in dict.fromkeys((*stated, *found)):
            inner = _difference(found.get(name), stated.get(name), f"{field}.{name}".lstrip("."))
            if inner:
                return inner
        return None
    if isinstance(found, list) and isinstance(stated, list) and len(found) == len(stated):
        pairs = enumerate(zip(found, stated))
        return next(filter(None, (_difference(*pair, f"{field}[{index}]") for index, pair in pairs)), None)
    if isinstance(found, float) and isinstance(stated, float):
        return None if math.isclose(found, stated, rel_tol=_SAME, abs_tol=1e-12) else (field, stated, found)
    return None if found == stated else (field, stated, found)


def _short(value):
    return f"{value:.6g}" if isinstance(value, float) else value
