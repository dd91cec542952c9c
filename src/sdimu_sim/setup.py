"""Package the sdimu_sim ROS 2 package; the entry points are the nodes and the command-line verbs."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "sdimu_sim"
HERE = Path(__file__).resolve().parent
LAUNCH = [str(path.relative_to(HERE)) for path in sorted((HERE / "launch").glob("*_launch.py"))]
VERSION = ElementTree.parse(HERE / "package.xml").findtext("version")
"""The package's one version: that of package.xml, which ROS reads; an installed package has it in its metadata."""

setup(
    name=NAME,
    version=VERSION,
    description="Simulated strapdown IMU on a rate table, with hidden effects",
    maintainer="sdimu-calibration maintainers",
    maintainer_email="maintainers@sdimu-calibration.org",
    license="Apache-2.0",
    license_files=["LICENSE"],
    platforms=["Linux x86_64"],
    python_requires=">=3.11",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    install_requires=[
        "PyYAML",
        "numpy>=1.26",
        "pydantic>=2",
        "rich",
        "scipy",
        "typer",
        f"rate_table_sim=={VERSION}",
        f"sdimu_calibration=={VERSION}",
    ],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", LAUNCH),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": ["sdimu_node = sdimu_sim.nodes.programs:sdimu_node"],
        "sdimu_calibration.verbs": ["simulate = sdimu_sim.cli.simulate:simulate", "run = sdimu_sim.cli.run:run"],
    },
)
