"""What a page takes home: the model, the calibration and the report in one archive."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import yaml

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model, StatedPrior
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.report.page import write_report
from sdimu_calibration.report.workbench.parts import span
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.report.workbench.state import State
from sdimu_calibration.shell_words import quoted
from sdimu_calibration.storage.files.effect_file import find_effects
from sdimu_calibration.storage.files.result_file import write_result


def model_files(model: Model, setting: Setting) -> dict[str, str]:
    """Return model.yaml, and a file for each effect of one's own, by name."""
    added = setting.added
    own = {f"effect-{k}.yaml": text for k, text in enumerate(added, 1) if "\n" in text.strip()}
    by_text = {text: name for name, text in own.items()}
    effects = [e if isinstance(e, str) else e.key for e in model.effects]
    for name in effects:
        _check_named(name)
    changed = {name for name, _, _ in setting.priors}
    priors = {p.name: _in_si(p) for p in model.priors if p.name not in changed}
    priors |= {name: {"value": mean, "sigma": sigma} for name, mean, sigma in setting.priors}
    content = {
        "format": "sdimu-model/1",
        "effects": [*effects, *(by_text.get(text, text) for text in added)],
        "velocity_sigma": f"{model.velocity_sigma!r} m/s",
        "position_sigma": f"{model.position_sigma!r} m",
        "settle": f"{model.settle_s!r} s",
        "body_frame": model.body_frame,
        **({"priors": priors} if priors else {}),
    }
    return {"model.yaml": yaml.safe_dump(content, sort_keys=False), **own}


def _check_named(name: str) -> None:
    try:
        find_effects(name)
    except DataError as error:
        raise DataError(
            f"the model to start from has an effect of your own, {name}: start from one without, and add it in the page"
        ) from error


def _in_si(prior: StatedPrior) -> dict[str, str]:
    """Write a prior of the model to start from as a model file has it."""
    factor = parse_unit(prior.unit or "1").factor
    return {"value": f"{prior.mean / factor!r} {prior.unit}", "sigma": f"{prior.sigma / factor!r} {prior.unit}"}


def command(setting: Setting, bag: str, options: Sequence[str] = ()) -> str:
    """Command that gives the same numbers, for the folder in which the archive is unpacked.

    `bag`: place or name of the recording; `options`: words that say how it is opened.
    """
    out = ["sdimu", "calibrate", quoted(bag), "--model", "model.yaml", *map(quoted, options)]
    if setting.held:
        out += ["--exclude-stops", ",".join(map(str, setting.held))]
    if setting.cut:
        out += ["--exclude-times", ",".join(map(span, setting.cut))]
    return " ".join(out)


def archive(
    model: Model, state: State, final: Diagnosis, recording: str, place: str = "", options: Sequence[str] = ()
) -> bytes:
    """Return a zip with model, result, report, the session, and the command that gives the same numbers."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        write_result(root / "result.json", final.after)
        write_report(root / "report.html", final.after, title=f"Workbench: {recording}", summary=summarise(final))
        texts = model_files(model, state.now) | {
            "session.json": json.dumps(state.as_json(), indent=1),
            "command.txt": f"{command(state.now, place or recording, options)}\n",
        }
        for name, text in texts.items():
            (root / name).write_text(text, encoding="utf-8")
        kept = io.BytesIO()
        with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as out:
            for path in sorted(root.iterdir()):
                out.write(path, path.name)
        return kept.getvalue()
