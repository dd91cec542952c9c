"""Rate tables as YAML files, with what is wrong with a simulated one."""

from __future__ import annotations

from pathlib import Path

from rate_table_sim.core.specification import Imperfections, TableSpecification
from sdimu_calibration.storage.files.table_file import read_table


def load_table(name_or_path: str | Path) -> TableSpecification:
    """Read a rate table."""
    table, file = read_table(name_or_path)
    sizes = file.imperfections.model_dump()
    return TableSpecification(
        name=table.name,
        axes=table.axes,
        sample_rate_hz=table.sample_rate_hz,
        imperfections=Imperfections(**{f"{name}_rad": size for name, size in sizes.items()}),
        limits=table.limits,
        joints=table.joints,
    )
