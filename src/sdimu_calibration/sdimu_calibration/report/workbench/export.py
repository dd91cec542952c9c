"""What a page takes home: the model, the calibration and the report in one archive."""

from __future__ import annotations

import io
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import yaml

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.report.page import write_report
from sdimu_calibration.storage.effect_file import find_effects
from sdimu_calibration.storage.result_file import write_result


def model_files(model: Model, added: Sequence[str]) -> dict[str, str]:
    """Return model.yaml, and a file for each effect of one's own, by name.

    Raises
    ------
    DataError
        When the model to start from has effects that only a file of its own can say.
    """
    own = {f"effect-{k}.yaml": text for k, text in enumerate(added, 1) if "\n" in text.strip()}
    by_text = {text: name for name, text in own.items()}
    effects = [e if isinstance(e, str) else e.key for e in model.effects]
    for name in effects:
        _check_named(name)
    content = {
        "format": "sdimu-model/1",
        "effects": [*effects, *(by_text.get(text, text) for text in added)],
        "velocity_sigma": f"{model.velocity_sigma!r} m/s",
        "position_sigma": f"{model.position_sigma!r} m",
        "settle": f"{model.settle_s!r} s",
        "body_frame": model.body_frame,
    }
    return {"model.yaml": yaml.safe_dump(content, sort_keys=False), **own}


def _check_named(name: str) -> None:
    try:
        find_effects(name)
    except DataError as error:
        raise DataError(
            f"the model to start from has an effect of your own, {name}: start from one without, and add it in the page"
        ) from error


def archive(model: Model, added: Sequence[str], final: Diagnosis, title: str) -> bytes:
    """Return a zip with model.yaml, result.json and report.html."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        write_result(root / "result.json", final.after)
        write_report(root / "report.html", final.after, title=title, summary=summarise(final))
        for name, text in model_files(model, added).items():
            (root / name).write_text(text, encoding="utf-8")
        kept = io.BytesIO()
        with zipfile.ZipFile(kept, "w", zipfile.ZIP_DEFLATED) as out:
            for path in sorted(root.iterdir()):
                out.write(path, path.name)
        return kept.getvalue()
