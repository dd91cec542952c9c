"""Files that `sdimu fleet` and `sdimu datasheet` read, damaged one at a time among sound ones."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np

from sdimu_calibration.core.fleet.datasheet import Sample, datasheet, known_terms
from sdimu_calibration.core.fleet.study import study
from sdimu_calibration.core.noise import Terms
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.report.fleet import page, sheet
from sdimu_calibration.storage.files.datasheet_file import Certificate, hashed, write_datasheet
from sdimu_calibration.storage.files.diagnosis_file import packed
from sdimu_calibration.storage.files.fleet_file import write_fleet
from sdimu_calibration.storage.files.fleet_folder import as_measured, candidates, gather
from sdimu_calibration.storage.files.json_file import write_json
from sdimu_calibration.storage.files.limits_file import read_limits
from sdimu_calibration.storage.files.noise_terms_file import read_noise_terms, write_noise_terms
from sdimu_calibration.storage.files.result_file import write_result

from .formats import Format, calibration, made, nothing
from .mutators import damaged_json, damaged_text

UNITS = 4
LIMITS = b"format: sdimu-limits/1\nname: a\nlimits:\n  gyro bias: 1 deg/h\n  gyro scale-factor error: 10 ppm\n"


def make_unit(folder: Path, number: int) -> Path:
    sound = calibration()
    rng = np.random.default_rng(number)
    origin = Origin(f"SN{number}", "1", 10**18 + number, 20.0, 19.0, 21.0, 0.1, f"bag{number}", "dtg", "daejeon")
    values = sound.values + rng.standard_normal(len(sound.values))
    place = folder / f"unit{number}" / "result.json"
    write_result(place, replace(sound, values=values, origin=origin))
    return place


def make_result(folder: Path) -> bytes:
    return make_unit(folder, 0).read_bytes()


def make_diagnosis(folder: Path) -> bytes:
    alone = {
        "labels": ["a", "b", "c"],
        "units": ["1"] * 3,
        "display_units": ["ppm"] * 3,
        "estimates": [1e-6, 2e-6, 3e-6],
        "sigmas": [1e-6] * 3,
        "correlations": packed(np.eye(3)),
    }
    model = list(calibration().model)
    write_json(folder / "d.json", {"format": "sdimu-diagnosis/1", "fit": {"before": {"model": model}}, "alone": alone})
    return (folder / "d.json").read_bytes()


def make_noise(folder: Path) -> bytes:
    one = Terms(np.full(4, 1e-6), np.full(4, 1e-7))
    terms = {f"{triad}_{axis}": one for triad in ("gyro", "accel") for axis in "xyz"}
    write_noise_terms(folder / "noise.json", "still", 60.0, terms)
    return (folder / "noise.json").read_bytes()


def use_fleet(path: Path) -> None:
    """Study a damaged file among sound ones, and write all pages."""
    folder = path.with_name("fleet")
    shutil.rmtree(folder, ignore_errors=True)
    for number in range(1, UNITS):
        make_unit(folder, number)
        (folder / f"unit{number}" / "diagnosis.json").write_bytes(make_diagnosis(path.parent))
    (folder / "damaged").mkdir()
    shutil.copy(path, folder / "damaged" / path.name)
    if path.name != "result.json":
        shutil.copy(make_unit(path.with_name("fifth"), 5), folder / "damaged" / "result.json")
    found = gather([folder])
    alone = candidates(found.given)
    done = study(as_measured(found.entries), found.entries[0].result.model, alone)
    write_fleet(folder / "fleet.json", found, done)
    page.write_page(folder / "fleet.html", found, done, alone, "Fleet")
    every = gather([folder], one_model=False).entries
    noise = [read_noise_terms(path)] if path.name == "noise.json" else []
    lines = datasheet([Sample(entry.unit, entry.result) for entry in every], noise)
    about = Certificate(recordings=hashed(every, []))
    write_datasheet(folder / "datasheet.json", lines, about, every)
    sheet.write_page(folder / "datasheet.html", lines, about, every, certificate=True)


FLEET_FORMATS: dict[str, Format] = {
    "result.json of a fleet": Format("result.json", make_result, damaged_json, use_fleet),
    "diagnosis.json of a fleet": Format("diagnosis.json", make_diagnosis, damaged_json, use_fleet),
    "noise.json": Format("noise.json", make_noise, damaged_json, use_fleet),
    "limits": Format("l.yaml", made(LIMITS), damaged_text, nothing(lambda p: read_limits(p, known_terms()))),
}
