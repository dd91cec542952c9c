"""From the rows on hidden effects to figures, a confusion table, and the page of the book."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import beta

from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.verdict import Verdict
from sdimu_study.hidden_outside import outside_kind
from sdimu_study.study import Table, good, head

FORMAT = "sdimu-hidden-campaign/1"
STRONG = 8.0
"""From this size on (in the sigma of the very test) an effect counts as strong."""
EXPLAINED = 0.9
"""Least share of the signature of something outside the catalogue that a right equation takes."""
NOTHING = "nothing"

Row = Mapping[str, Any]


def summarise(rows: Sequence[Row]) -> dict[str, Any]:
    """Judge a campaign.

    Parameters
    ----------
    rows : sequence of mapping
        Of `hidden.STUDY`, all kinds; failed runs (with ``error``) are counted apart.

    Returns
    -------
    dict
        ``figures`` (name, count, number, share, 95 % interval, wanted), ``confusion``, ``outside``, ``misses``,
        ``failed``.
    """
    done = good(rows)
    return {
        "format": FORMAT,
        "runs": dict(Counter(r["kind"] for r in done)),
        "failed": [{"seed": r["seed"], "error": r["error"]} for r in rows if "error" in r],
        "figures": [*_named(done), *_clean(done), *_outside(done), *_noise(done), *_mended(done)],
        "confusion": confusion(done),
        "outside": _outside_table(done),
        "misses": [_miss(r) for r in done if r["kind"] in ("strong", "pair") and not _all_named(r)],
    }


def share(name: str, hits: Sequence[bool], wanted: float | None, most: bool = False) -> dict[str, Any]:
    """Share of hits with its 95 % interval (Clopper & Pearson 1934).

    `most`: wanted is an upper limit; None: nothing is asked.
    """
    n, k = len(hits), int(sum(hits))
    low = float(beta.ppf(0.025, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(0.975, k + 1, n - k)) if k < n else 1.0
    value = k / n if n else None
    figure = {"name": name, "count": k, "of": n, "value": value, "low": low, "high": high}
    if wanted is None:
        return figure | {"wanted": "", "reached": None}
    reached = value is not None and (value <= wanted if most else value >= wanted)
    return figure | {"wanted": f"{'<=' if most else '>='} {wanted:.0%}", "reached": reached}


def number(name: str, values: Sequence[float], low: float, high: float) -> dict[str, Any]:
    """Root mean square of values, with its standard error and the interval wanted."""
    x = np.asarray(values, dtype=float) ** 2
    if not len(x):
        nothing: dict[str, Any] = dict.fromkeys(("value", "low", "high"))
        return nothing | {"name": name, "of": 0, "wanted": f"{low} to {high}", "reached": False}
    rms = float(np.sqrt(x.mean()))
    error = float(x.std() / np.sqrt(len(x)) / (2.0 * rms)) if rms else 0.0
    return {
        "name": name,
        "of": len(x),
        "value": rms,
        "low": rms - 2 * error,
        "high": rms + 2 * error,
        "wanted": f"{low} to {high}",
        "reached": low <= rms <= high,
    }


def _all_named(row: Row) -> bool:
    return all(t["in_class"] for t in row["truths"])


def _is_strong(row: Row) -> bool:
    return bool(row["kind"] == "strong" and (row["truths"][0]["realised"] or 0.0) >= STRONG)


def _named(rows: Sequence[Row]) -> list[dict[str, Any]]:
    strong = [r["truths"][0] for r in rows if _is_strong(r)]
    weak = [r["truths"][0] for r in rows if r["kind"] == "weak"]
    pairs = [r for r in rows if r["kind"] == "pair"]
    sized = [t for t in strong if t["in_class"] and t["error_sigmas"] is not None]
    return [
        share("one effect of 8 to 30 sigma: in the first class named", [t["in_class"] for t in strong], 0.95),
        share("... named first", [t["best"] for t in strong], None),
        share("... amplitude within 3 sigma, where named", [abs(t["error_sigmas"]) <= 3.0 for t in sized], 0.99),
        share("one effect of 5 sigma: in the first class named", [t["in_class"] for t in weak], 0.75),
        share("two effects of 10 to 30 sigma: both named", [_all_named(r) for r in pairs], 0.85),
    ]


def _clean(rows: Sequence[Row]) -> list[dict[str, Any]]:
    clean = [r for r in rows if r["kind"] == "clean"]
    z = [float(np.sqrt(r["scan_z2"] / r["scan_count"])) for r in clean]
    return [
        share("nothing hidden: something found", [r["verdict"] != Verdict.CONSISTENT for r in clean], 0.05, most=True),
        number("nothing hidden: RMS z of all candidates", z, 0.95, 1.05),
    ]


def outside_passed(row: Row) -> bool:
    """Whether something outside the catalogue ended as unexplained, or as terms that are right.

    Right is what takes nearly all of the signature: an equation, or two steps that make a pulse.
    """
    if row["verdict"] == Verdict.UNEXPLAINED:
        return True
    return bool(row["named"]) and (row["truths"][0]["share"] or 0.0) >= EXPLAINED


def _worse(row: Row) -> bool:
    # What was tried on the way to "unexplained" is not accepted.
    accepted = bool(row["named"]) and row["verdict"] != Verdict.UNEXPLAINED
    return accepted and row["stops_after"] is not None and row["stops_after"] > row["stops_before"]


def _outside(rows: Sequence[Row]) -> list[dict[str, Any]]:
    out = [r for r in rows if r["kind"] == "outside"]
    return [
        share("outside the catalogue: unexplained or rightly explained", [outside_passed(r) for r in out], 0.9),
        share("... accepted although held-out stops were predicted worse", [_worse(r) for r in out], 0.0, most=True),
    ]


def _noise(rows: Sequence[Row]) -> list[dict[str, Any]]:
    noise = [r for r in rows if r["kind"] == "noise"]
    # Outliers that the screen takes away are told in its findings; what is left may well be as specified.
    hits = [not r["named"] and (r["verdict"] == Verdict.NOISE_MODEL_WRONG or "spike" in r["data"]) for r in noise]
    return [share("wrong noise: found as such, no effect named", hits, 0.95)]


def _mended(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Tell what adding the right effect does; without those whose time is scanned, which fit as the scan is fine."""
    right = [
        r
        for r in rows
        if _is_strong(r) and r["truths"][0]["best"] and len(r["named"]) == 1 and r["truths"][0]["option"] is None
    ]
    wanted = (
        ("RMS z of the baseline coefficients before", "rms_z_before", 1.15, 99.0),
        ("RMS z of the baseline coefficients after", "rms_z_after", 0.85, 1.15),
        ("held-out RMS before", "held_out_before", 1.0, 99.0),
        ("held-out RMS after", "held_out_after", 0.97, 1.03),
    )
    word = "right effect added"
    return [number(f"{word}: {text}", [r[key] for r in right], low, high) for text, key, low, high in wanted]


def confusion(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Count families named by families drawn, single effects of any size; one entry a family drawn."""
    drawn: dict[str, list[Row]] = {}
    for row in rows:
        if row["kind"] in ("weak", "strong"):
            drawn.setdefault(row["truths"][0]["family"], []).append(row)
    return [
        {
            "family": family,
            "draws": len(own),
            "in_class": sum(bool(r["truths"][0]["in_class"]) for r in own),
            "named_first": dict(Counter(_first_family(r) for r in own).most_common()),
        }
        for family, own in sorted(drawn.items())
    ]


def _first_family(row: Row) -> str:
    if not row["named"]:
        return NOTHING if row["verdict"] == Verdict.CONSISTENT else str(row["verdict"])
    return "own equation" if row["own"] else family_of(row["named"][0])


def _outside_table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    table: dict[str, Counter[str]] = {}
    for row in rows:
        if row["kind"] != "outside":
            continue
        word = row["verdict"]
        if row["named"] and word != Verdict.UNEXPLAINED:
            what = "equation" if row["own"] else "catalogue terms"
            word = f"{'right' if outside_passed(row) else 'other'} {what}"
        table.setdefault(outside_kind(row["truths"][0]["name"]), Counter())[word] += 1
    return [{"shape": k, "ended": dict(v.most_common())} for k, v in sorted(table.items())]


def _miss(row: Row) -> dict[str, Any]:
    return {
        "seed": row["seed"],
        "kind": row["kind"],
        "plan": row["plan"],
        "hidden": [t["text"] for t in row["truths"]],
        "realised": [t["realised"] for t in row["truths"]],
        "verdict": row["verdict"],
        "named": row["named"],
        "steps": row["steps"],
    }


def family_of(label: str) -> str:
    """Registry name of the effect that a label of the catalogue belongs to."""
    effect = resolve(label.partition("(")[0])
    return effect.family or effect.name


def page(summary: Mapping[str, Any]) -> str:
    """Text of the page."""
    runs = ", ".join(f"{n} {kind}" for kind, n in summary["runs"].items())
    parts = [
        head("hidden"),
        f"Runs: {runs}; seeds from {summary.get('first_seed', '?')}; {len(summary['failed'])} failed.\n",
        *([f"{summary['note']}\n"] if summary.get("note") else []),
        f"## Figures\n\n{_figures(summary)}",
        "## Families drawn against families named\n",
        "One effect, 5 sigma and 8 to 30 sigma together. `nothing`: the recording was called consistent.\n",
        _confusion(summary),
        f"## Outside the catalogue\n\n{_shapes(summary)}",
        f"## Strong effects that were missed\n\n{_misses(summary)}",
    ]
    return "\n".join(parts)


def _figures(summary: Mapping[str, Any]) -> str:
    rows = []
    for f in summary["figures"]:
        if f["value"] is None:
            continue
        if "count" in f:
            value, interval = f"{f['count']} of {f['of']} = {f['value']:.1%}", f"{f['low']:.1%} to {f['high']:.1%}"
        else:
            value, interval = f"{f['value']:.3f} ({f['of']} runs)", f"{f['low']:.3f} to {f['high']:.3f}"
        reached = {True: "reached", False: "missed", None: ""}[f["reached"]]
        rows.append((f["name"], value, interval, f["wanted"], reached))
    return Table(("", "found", "95 % interval", "wanted", ""), rows).markdown()


def _confusion(summary: Mapping[str, Any]) -> str:
    rows = [(c["family"], str(c["draws"]), str(c["in_class"]), _counts(c["named_first"])) for c in summary["confusion"]]
    return Table(("drawn", "draws", "in the class named", "named first"), rows).markdown()


def _shapes(summary: Mapping[str, Any]) -> str:
    return Table(("shape", "ended as"), [(o["shape"], _counts(o["ended"])) for o in summary["outside"]]).markdown()


def _counts(words: Mapping[str, int]) -> str:
    return ", ".join(f"{word} {n}" for word, n in words.items())


def _misses(summary: Mapping[str, Any]) -> str:
    rows = [
        (
            str(m["seed"]),
            m["plan"],
            "<br>".join(m["hidden"]),
            ", ".join("?" if s is None else f"{s:.1f}" for s in m["realised"]),
            m["verdict"],
            "<br>".join(m["named"]),
        )
        for m in summary["misses"]
    ]
    return Table(("seed", "plan", "hidden", "sigma", "verdict", "named"), rows).markdown()
