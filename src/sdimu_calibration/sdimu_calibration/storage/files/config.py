"""Configuration files (YAML) <-> the core's dataclasses.

A file is named by a path, or by its bare name in ``config/<kind>/`` or, where that has none, in the working directory.
Quantities are text with a unit (``"2 deg/s"``); every other spelling is refused with one line that names file and key.
"""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Hashable, Mapping
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.site_reference import BY_FORMULA, DEFLECTION_SIGMAS, GRAVITY_SIGMAS, LATITUDE_SIGMAS
from sdimu_calibration.core.specification import ImuSpecification, Model, Site, StatedPrior
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.storage.files.bounded_file import check_regular, read_text
from sdimu_calibration.storage.files.quantities import (
    number_of,
    quantity,
    quantity_of_any_unit,
    sigma_up_to,
    signed_quantity,
)

CONFIG_VARIABLE = "SDIMU_CONFIG"
"""Environment variable that names the config folder."""

LONGEST_PLAN_S = 7.0 * 86400.0
"""A plan beyond a week is one with a wrong unit; its samples would not fit into the memory."""

MOST_TURNS = 2000
"""Number of turns of a plan (1): those of a test are tens, and a forecast of thousands takes minutes."""

LARGEST_LATITUDE_SIGMA = math.radians(2.0)
"""Largest sigma of a latitude (rad): beyond it the square of the error counts, and a map knows better."""

LARGEST_DEFLECTION_SIGMA = math.radians(0.1)
"""Largest sigma of the deflection of the vertical (rad): the largest deflections are arcminutes."""

LARGEST_GRAVITY_SIGMA = 0.05
"""Largest sigma of gravity (m/s^2): from the equator to a pole it changes by as much."""

LONGEST_FILE = 1 << 20
"""Bytes of a configuration at most: reading YAML takes ten seconds a megabyte."""

DEEPEST = 32
"""Lists in lists and keys under keys at most: a configuration needs five."""

_PACKAGE = Path(__file__).resolve().parents[2]
_REPOSITORY = _PACKAGE.parents[2]

_SUFFIXES = (".yaml", ".yml", ".json")


class Schema(BaseModel):
    """Base of every file schema: no unknown keys, no infinities."""

    # Built at the first file that is read: to build all of them takes each command .1 s.
    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, frozen=True, protected_namespaces=(), defer_build=True
    )

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_value(cls, value: Any, about: ValidationInfo) -> Any:
        """Refuse `yes` for a number, which YAML takes for true, and Python for 1."""
        kinds = _parts(cls.model_fields[str(about.field_name)].annotation)
        number = (int in kinds or float in kinds) and not (bool in kinds or str in kinds)
        given = value if isinstance(value, list | tuple) else [value]
        if number and any(isinstance(one, bool) for one in given):
            raise ValueError(f"expected a number, found '{value}', which YAML takes for yes or no")
        return value


def _parts(kind: Any) -> list[Any]:
    """List a type and all that it is made of."""
    return [kind, *(part for one in get_args(kind) for part in _parts(one))]


S = TypeVar("S", bound=Schema)


def config_folder() -> Path:
    """Folder of the configuration: `SDIMU_CONFIG`, else the package's own, else the repository's.

    A wheel and a build by colcon carry the files inside the package; an editable install leaves them in the repository.
    """
    named = os.environ.get(CONFIG_VARIABLE)
    if named:
        if not Path(named).is_dir():
            raise DataError(f"{named}: not a folder (environment variable {CONFIG_VARIABLE})")
        return Path(named)
    for parent in _PACKAGE, _REPOSITORY:
        if (parent / "config" / "plan").is_dir():
            return parent / "config"
    raise DataError(f"no config folder found; set {CONFIG_VARIABLE} to the folder that holds plan/, imu/, model/")


def find_config(kind: str, name_or_path: str | Path) -> Path:
    """Path of a configuration file.

    `kind`: folder inside the config folder: ``plan``, ``imu``, ``model``, ``site``, ``table``, ``temperature``.
    `name_or_path`: a bare name is looked up in the config folder, then among the files of the working directory;
    whatever looks like a path is taken as it is.
    """
    text = str(name_or_path)
    path = Path(text)
    if isinstance(name_or_path, Path) or _is_path(text):
        if path.is_file():
            return path
        if path.is_dir():
            raise DataError(f"{path}: is a folder; name {_file_in(path, kind)}, or one of: {', '.join(names_of(kind))}")
        if path.exists():
            check_regular(path)
        raise DataError(f"{path}: no such {kind} file")
    folder = config_folder() / kind
    for suffix in _SUFFIXES:
        if (folder / f"{text}{suffix}").is_file():
            return folder / f"{text}{suffix}"
    if path.is_file():
        return path
    known = names_of(kind)
    near = get_close_matches(text, known, n=1)
    hint = f"did you mean '{near[0]}'? There are: " if near else "there are: "
    raise DataError(f"no {kind} named '{text}' ({hint}{', '.join(known) or 'none'}; or give a path to a file)")


def names_of(kind: str) -> list[str]:
    """Names in a folder of the configuration."""
    return sorted(p.stem for p in (config_folder() / kind).glob("*") if p.suffix in _SUFFIXES)


def _file_in(folder: Path, kind: str) -> str:
    """Say which file of a folder is meant: the only one that it may be, else that it is a YAML file."""
    files = sorted(p for p in folder.glob("*") if p.suffix in _SUFFIXES)
    return f"the {kind} file in it ({files[0]})" if len(files) == 1 else f"a YAML file of kind {kind}"


def _is_path(text: str) -> bool:
    """Whether a text is the path of a file, and no bare name."""
    return Path(text).suffix in _SUFFIXES or Path(text).name != text


def stated_path(name_or_path: str | None) -> str:
    """Path of a file of the user's own, from the root, so that it is found from any folder; empty for a bare name."""
    return str(Path(name_or_path).resolve()) if name_or_path and _is_path(name_or_path) else ""


class _UniqueKeys(yaml.SafeLoader):
    """YAML of plain values: a key written twice is an error, and so is what can nest without end."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "aliases (*name) are not read, write it out", mark)
        if self._depth > DEEPEST:
            raise yaml.composer.ComposerError(None, None, f"nested more than {DEEPEST} deep", mark)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[Hashable] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if isinstance(key, Hashable) and key in seen:
                raise yaml.constructor.ConstructorError(None, None, f"key '{key}' is there twice", node.start_mark)
            if isinstance(key, Hashable):
                seen.add(key)
        return super().construct_mapping(node, deep)


def read_mapping(path: Path, longest: int = LONGEST_FILE) -> dict[str, Any]:
    """Content of a YAML file of `longest` bytes at most, keys and values; DataError with file and line otherwise."""
    try:
        data = yaml.load(read_text(path, longest), Loader=_UniqueKeys)
    except DataError:
        raise
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: is not text (expected YAML in UTF-8)") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f" line {mark.line + 1}:" if mark else ""
        what = getattr(error, "problem", None) or "cannot be read"
        raise DataError(f"{path}:{where} not valid YAML: {what}") from error
    except Exception as error:
        # What text makes of a number or a date that is none: errors of int(), of datetime, of the stack.
        raise DataError(f"{path}: not valid YAML: {error or type(error).__name__}") from error
    if not isinstance(data, dict):
        raise DataError(f"{path}: expected 'key: value' lines, found {'nothing' if data is None else 'something else'}")
    return data


def read_yaml(path: Path, schema: type[S], longest: int = LONGEST_FILE) -> S:
    """Read a YAML file of `longest` bytes at most into a schema."""
    return check(read_mapping(path, longest), schema, str(path))


def check(data: Mapping[str, Any], schema: type[S], source: str) -> S:
    """Validate plain data against a schema; `source` names it in the DataError."""
    try:
        return schema.model_validate(data)
    except ValidationError as error:
        first = min(error.errors(), key=_rank)
        key = one_line(".".join(str(part) for part in first["loc"]), _LONGEST_KEY)
        raise DataError(
            f"{source}: {key}: {_message(first, schema)}" if key else f"{source}: {first['msg']}"
        ) from error


_LONGEST_KEY = 200
"""Number of characters of a key that a message shows (1): what is wrong with it stands behind."""
_SHAPES = {"dict_type": "write one line `name: value` for each, below the key", "list_type": "write a list [a, b, ...]"}
"""What to write where a file has something else in the place of a mapping or list."""


def _rank(error: Any) -> int:
    """Order errors by what says best what to mend.

    A file of another kind has hardly a key that is right. A misspelt key is unknown and leaves the right one missing.
    """
    if error["loc"] == ("format",) and error["type"] != "missing":
        return 0
    return 1 if error["type"] == "extra_forbidden" else 2


def _message(error: Any, schema: type[BaseModel]) -> str:
    kind, found = error["type"], error.get("input")
    if kind == "extra_forbidden":
        known = _known_keys(schema, error["loc"][:-1])
        near = get_close_matches(str(error["loc"][-1]), known, n=1)
        return f"unknown key{f'; did you mean {near[0]}?' if near else ''} (known keys: {', '.join(known)})"
    if kind == "missing":
        return "missing key"
    if kind in _SHAPES:
        return f"{_SHAPES[kind]} (found: {'nothing' if found is None else reprlib.repr(found)})"
    text = str(error["msg"]).removeprefix("Value error, ")
    text = text[:1].lower() + text[1:] if kind != "value_error" else text
    return text if kind == "value_error" else f"{text} (found: {reprlib.repr(found)})"


def _known_keys(schema: type[BaseModel], loc: tuple[Any, ...]) -> list[str]:
    for part in loc:
        if isinstance(part, str) and part in schema.model_fields:
            annotation = schema.model_fields[part].annotation
            for inner in (annotation, *get_args(annotation)):
                if isinstance(inner, type) and issubclass(inner, BaseModel):
                    schema = inner
    return list(schema.model_fields)


class _TurnFile(Schema):
    axis: Literal["X", "Y", "Z"]
    angle: Annotated[float, quantity("deg")]
    rate: Annotated[float, quantity("deg/s"), Field(gt=0)] | None = None
    dwell: Annotated[float, quantity("s"), Field(gt=0)] | None = None


Name = Annotated[str, AfterValidator(partial(one_line, longest=200))]
"""What a file calls itself: on one line of printable characters wherever it is shown."""


class _PlanFile(Schema):
    format: Literal["sdimu-plan/1"] = "sdimu-plan/1"
    name: Name | None = None
    dwell: Annotated[float, quantity("s"), Field(gt=0)]
    first_dwell: Annotated[float, quantity("s"), Field(gt=0)] | None = None
    rate: Annotated[float, quantity("deg/s"), Field(gt=0)]
    acceleration: Annotated[float, quantity("deg/s^2"), Field(gt=0)]
    turns: tuple[_TurnFile, ...]


class _NoiseFile(Schema):
    gyro: Annotated[float, quantity("deg/h/sqrt(Hz)"), Field(ge=0)]
    accel: Annotated[float, quantity("ug/sqrt(Hz)"), Field(ge=0)]
    gyro_random_walk: Annotated[float, quantity("deg/h/sqrt(h)"), Field(ge=0)] = 0.0
    accel_random_walk: Annotated[float, quantity("ug/sqrt(h)"), Field(ge=0)] = 0.0
    gyro_quantisation: Annotated[float, quantity("arcsec"), Field(ge=0)] = 0.0
    accel_quantisation: Annotated[float, quantity("mm/s"), Field(ge=0)] = 0.0
    gyro_bias_instability: Annotated[float, quantity("deg/h"), Field(ge=0)] = 0.0
    accel_bias_instability: Annotated[float, quantity("ug"), Field(ge=0)] = 0.0


class _ImuFile(Schema):
    format: Literal["sdimu-imu/1"] = "sdimu-imu/1"
    name: Name | None = None
    grade: Literal["navigation", "tactical", "mems"] = "navigation"
    noise: _NoiseFile
    prior: dict[str, Annotated[tuple[float, str], BeforeValidator(quantity_of_any_unit)]] = {}


class _PriorFile(Schema):
    value: Annotated[tuple[float, str], BeforeValidator(signed_quantity)]
    sigma: Annotated[tuple[float, str], BeforeValidator(quantity_of_any_unit)]


class _ModelFile(Schema):
    format: Literal["sdimu-model/1"] = "sdimu-model/1"
    name: Name | None = None
    effects: tuple[str, ...] = Field(min_length=1)
    velocity_sigma: Annotated[float, quantity("m/s"), Field(gt=0)] = Model.velocity_sigma
    position_sigma: Annotated[float, quantity("m"), Field(gt=0)] = Model.position_sigma
    settle: Annotated[float, quantity("s"), Field(ge=0)] = Model.settle_s
    body_frame: Literal["accelerometer_triad", "prior"] = "accelerometer_triad"
    priors: dict[str, _PriorFile] = {}


class _SiteFile(Schema):
    format: Literal["sdimu-site/1"] = "sdimu-site/1"
    name: Name | None = None
    latitude_deg: Annotated[float, number_of("deg"), Field(ge=-90.0, le=90.0)]
    height_m: Annotated[float, number_of("m"), Field(ge=-5000.0, le=20000.0)]
    gravity_m_s2: Annotated[float, number_of("m/s^2"), Field(gt=9.5, lt=10.0)] | None = None
    initial_azimuth_deg: Annotated[float, number_of("deg"), Field(ge=-360.0, le=360.0)] | None = None
    magnetic_field_nt: tuple[float, float, float] | None = None
    initial_azimuth_sigma_deg: Annotated[float, number_of("deg"), Field(gt=0.0, le=360.0)] = math.degrees(
        Site.initial_azimuth_sigma_rad
    )
    latitude_sigma: Annotated[float, sigma_up_to(LARGEST_LATITUDE_SIGMA, "deg", LATITUDE_SIGMAS)] = 0.0
    deflection_sigma: Annotated[float, sigma_up_to(LARGEST_DEFLECTION_SIGMA, "arcsec", DEFLECTION_SIGMAS)] = 0.0
    gravity_sigma: Annotated[float, sigma_up_to(LARGEST_GRAVITY_SIGMA, "mgal", GRAVITY_SIGMAS)] = 0.0

    @field_validator("gravity_sigma", mode="before")
    @classmethod
    def _of_a_gravity(cls, value: Any, about: ValidationInfo) -> Any:
        """Refuse a word on how a gravity was found that the file does not state."""
        word = isinstance(value, str) and value in GRAVITY_SIGMAS and value != BY_FORMULA
        if word and about.data.get("gravity_m_s2", True) is None:
            raise ValueError(f"'{value}' says how gravity_m_s2 was found: state that, too, or write '{BY_FORMULA}'")
        return value


def load_plan(name_or_path: str | Path) -> Plan:
    """Read a test plan.

    ``rate`` and ``dwell`` of a turn replace the plan's for that turn and for the stop after it;
    ``first_dwell`` is the stop before the first turn.
    """
    path = find_config("plan", name_or_path)
    file = read_yaml(path, _PlanFile)
    if len(file.turns) > MOST_TURNS:
        raise DataError(f"{path}: turns: {len(file.turns)} of them, more than {MOST_TURNS}; make several plans of them")
    for number, turn in enumerate(file.turns, start=1):
        if turn.angle == 0.0:
            raise DataError(f"{path}: turn {number}: angle is zero (expected a signed angle such as '90 deg')")
    plan = Plan(
        name=file.name or path.stem,
        dwell_s=(file.first_dwell or file.dwell, *(t.dwell or file.dwell for t in file.turns)),
        turns=tuple(Turn(t.axis, t.angle, t.rate or file.rate) for t in file.turns),
        acceleration_rad_s2=file.acceleration,
    )
    if plan.duration_s > LONGEST_PLAN_S:
        raise DataError(
            f"{path}: lasts {plan.duration_s / 3600.0:.4g} h, more than {LONGEST_PLAN_S / 3600.0:g} h "
            "(check the units of dwell, rate and angle)"
        )
    return plan


def imu_mapping(name_or_path: str | Path) -> dict[str, Any]:
    """Content of an IMU file as it is written, for a copy with other numbers; DataError where it is no IMU file."""
    path = find_config("imu", name_or_path)
    content = read_mapping(path)
    check(content, _ImuFile, str(path))
    return content


def load_imu(name_or_path: str | Path) -> ImuSpecification:
    """Read an IMU's specification; priors come in SI, with their units for `imu_model.build` to check."""
    path = find_config("imu", name_or_path)
    file = read_yaml(path, _ImuFile)
    return ImuSpecification(
        name=file.name or path.stem,
        file=str(path),
        gyro_white_noise=file.noise.gyro,
        accel_white_noise=file.noise.accel,
        **file.noise.model_dump(exclude={"gyro", "accel"}),
        prior={name: size for name, (size, _) in file.prior.items()},
        prior_units={name: unit for name, (_, unit) in file.prior.items()},
        grade=file.grade,
    )


def load_model(name_or_path: str | Path) -> Model:
    """Read a model to estimate; whether its effects exist is the registry's to say."""
    path = find_config("model", name_or_path)
    file = read_yaml(path, _ModelFile)
    repeated = sorted({e for e in file.effects if file.effects.count(e) > 1})
    if repeated:
        raise DataError(f"{path}: effects: '{repeated[0]}' is there twice (name every effect once)")
    return Model(
        effects=file.effects,
        velocity_sigma=file.velocity_sigma,
        position_sigma=file.position_sigma,
        settle_s=file.settle,
        body_frame=file.body_frame,
        priors=tuple(_stated_prior(f"{path}: priors.{name}", name, one) for name, one in file.priors.items()),
    )


def _stated_prior(where: str, name: str, one: _PriorFile) -> StatedPrior:
    (mean, unit), (sigma, other) = one.value, one.sigma
    if parse_unit(unit or "1").dimension != parse_unit(other or "1").dimension or bool(unit) != bool(other):
        raise DataError(f"{where}: value and sigma have different units, '{unit}' and '{other}'")
    return StatedPrior(name, mean, sigma, unit)


def load_site(name_or_path: str | Path) -> Site:
    """Read a site."""
    file = read_yaml(find_config("site", name_or_path), _SiteFile)
    azimuth, field = file.initial_azimuth_deg, file.magnetic_field_nt
    return Site(
        latitude_rad=math.radians(file.latitude_deg),
        height_m=file.height_m,
        gravity_m_s2=file.gravity_m_s2,
        initial_azimuth_rad=None if azimuth is None else math.radians(azimuth),
        initial_azimuth_sigma_rad=math.radians(file.initial_azimuth_sigma_deg),
        magnetic_field_t=None if field is None else (1e-9 * field[0], 1e-9 * field[1], 1e-9 * field[2]),
        latitude_sigma_rad=file.latitude_sigma,
        gravity_sigma_m_s2=file.gravity_sigma,
        deflection_sigma_rad=file.deflection_sigma,
    )
