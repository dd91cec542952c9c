"""Package the rate_table_sim ROS 2 package; the entry points are the nodes and the command-line verbs."""

from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

NAME = "rate_table_sim"
HERE = Path(__file__).resolve().parent
VERSION = ElementTree.parse(HERE / "package.xml").findtext("version")
"""The package's one version: that of package.xml, which ROS reads; an installed package has it in its metadata."""

setup(
    name=NAME,
    version=VERSION,
    description="Simulated three-axis rate table",
    maintainer="sdimu-calibration maintainers",
    maintainer_email="maintainers@sdimu-calibration.org",
    license="Apache-2.0",
    license_files=["LICENSE"],
    platforms=["Linux x86_64"],
    python_requires=">=3.11",
    packages=find_packages(),
    package_data={NAME: ["py.typed"]},
    install_requires=["numpy>=1.26", "pydantic>=2", "scipy", f"sdimu_calibration=={VERSION}"],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={"console_scripts": ["rate_table_node = rate_table_sim.nodes.programs:rate_table_node"]},
)
