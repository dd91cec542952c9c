"""Which recordings are a set, and the order in which they are taken."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.joint.member import Member, Report
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Option, Work


def check_members(members: Sequence[Member]) -> None:
    """Refuse recordings that are no set."""
    names = [m.name for m in members]
    for name in names:
        if names.count(name) > 1:
            raise DataError(f"two recordings of the set are called '{name}': state each one once, under its own name")
    serials = sorted({m.serial for m in members if m.serial})
    if len(serials) > 1:
        raise DataError(
            f"the recordings are of several units ({', '.join(serials)}): a joint fit is of one; calibrate each by "
            f"itself, then compare them with {Work.FLEET}"
        )


def in_order(reports: Sequence[Report]) -> list[Report]:
    """Put reports into the order of their starts, those of one start into that of their samples.

    Sums depend on the order of their terms in the last digit, and a set begins with its first recording. So the order
    is one that the recordings give: neither that in which they were named nor their names.
    """

    def place(report: Report) -> tuple[int, float, float]:
        return report.start_ns, report.data.get("samples", 0.0), report.data.get("checksum", 0.0)

    return sorted(reports, key=place)


def check_different(reports: Sequence[Report]) -> None:
    """Refuse a recording that stands twice, by another path or as a copy: it would count as two that agree."""
    seen: dict[tuple[int, bytes], str] = {}
    for report in reports:
        first = seen.setdefault((report.start_ns, report.values.tobytes()), report.name)
        if first != report.name and len(report.values):
            raise DataError(f"'{first}' and '{report.name}' are the same recording: name it once")


def check_one_grade(reports: Sequence[Report]) -> None:
    """Refuse recordings of IMUs of different grades: they are of several units, whatever their serials say."""
    first: dict[str, Report] = {}
    for report in reports:
        first.setdefault(report.imu.grade, report)
    if len(first) > 1:
        told = ", ".join(f"{r.name}: {r.imu.name}, {grade}" for grade, r in first.items())
        raise DataError(
            f"the recordings are of IMUs of different grades ({told}), and a joint fit is of one unit: if it is one, "
            f"state its {Option.IMU}; if not, calibrate each by itself"
        )


def check_one_site(reports: Sequence[Report]) -> None:
    """Refuse different sites where one of them states a sigma: what it is off by is one number for all recordings."""
    sites = {report.site: report for report in reports}
    told = list(dict.fromkeys(key for site in sites if site is not None for key in site.sigmas))
    if len(sites) > 1 and told:
        first, other = list(sites.values())[:2]
        raise DataError(
            f"{first.name} and {other.name} are at different sites, and one states how well it is known: a joint fit "
            f"estimates the error of one site; leave {', '.join(told)} out, or calibrate each site by itself"
        )
