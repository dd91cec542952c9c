"""Package the sdimu_calibration ROS 2 package; the entry points are the nodes and the command-line verbs."""

import os
import shutil
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

NAME = "sdimu_calibration"
CONFIG = Path(__file__).resolve().parents[2] / "config"
"""The repository's configuration files, which every copy that is installed takes along."""
HERE = Path(__file__).resolve().parent
VERSION = ElementTree.parse(HERE / "package.xml").findtext("version")
"""The package's one version: that of package.xml, which ROS reads; an installed package has it in its metadata."""
LAUNCH = [str(path.relative_to(HERE)) for path in sorted((HERE / "launch").glob("*_launch.py"))]
SHARED_CONFIG = [
    (f"share/{NAME}/config/{folder.name}", [os.path.relpath(path, HERE) for path in sorted(folder.iterdir())])
    for folder in sorted(CONFIG.glob("*"))
    if folder.is_dir()
]
"""The same once more where users of ROS look for them: layouts, tables, analyzers."""

RUN_TIME = [
    "PyYAML",
    "lz4",
    "mcap",
    # `core/compiled.py` replaces parts of it that are not public: the versions with which the tests pass.
    "numba<0.69",
    "numpy>=1.26",
    "pydantic>=2",
    "rich",
    "ros-jazzy-common-interfaces",
    "ros-jazzy-rclpy[fastrtps]",
    "rosbags>=0.10",
    "scipy",
    "typer",
    "zstandard",
]
EXTRAS = {
    "workbench": ["dash"],
    "notebook": ["pandas", "plotly"],
    "pictures": ["matplotlib"],
    "matlab": ["h5py", "mat-io"],
    "study": ["dask", "distributed", "matplotlib"],
    "test": [
        "AllanTools",
        "axe-playwright-python",
        "hypothesis",
        "import-linter",
        "mcap-ros2-support",
        "mypy",
        "numpydoc",
        "packaging",
        "pandas",
        "pillow",
        "playwright",
        "psutil",
        "pytest",
        "pytest-timeout",
        "pytest-xdist",
        "ruff",
        "types-PyYAML",
    ],
    "build": ["colcon-common-extensions"],
    "docs": [
        "furo",
        "math-core",
        "myst-nb",
        "myst-parser",
        "numpydoc",
        "pandas",
        "sphinx",
        "sphinxcontrib-bibtex",
        "ziamath",
    ],
}


class BuildWithConfig(build_py):
    """Copy config/ into the package that is built; an editable install finds it in the repository."""

    def _config(self):
        target = Path(self.build_lib) / NAME / "config"
        return {path: target / path.relative_to(CONFIG) for path in sorted(CONFIG.rglob("*")) if path.is_file()}

    def run(self):
        super().run()
        if self.editable_mode:
            return
        if not CONFIG.is_dir():
            raise SystemExit(f"{CONFIG}: no such folder (build from the repository, not from a part of it)")
        for source, target in self._config().items():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)

    def get_outputs(self, include_bytecode=True):
        added = [] if self.editable_mode else [str(target) for target in self._config().values()]
        return super().get_outputs(include_bytecode) + added


setup(
    name=NAME,
    version=VERSION,
    description="Navigation-level calibration of a strapdown IMU on a rate table",
    maintainer="sdimu-calibration maintainers",
    maintainer_email="maintainers@sdimu-calibration.org",
    license="Apache-2.0",
    license_files=["LICENSE"],
    platforms=["Linux x86_64"],
    python_requires=">=3.11",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "report/*/*.css", "report/*/*.js", "report/*/*.gz", "report/*/*.npz"]},
    cmdclass={"build_py": BuildWithConfig},
    install_requires=RUN_TIME,
    extras_require=EXTRAS,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", LAUNCH),
        *SHARED_CONFIG,
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "sdimu = sdimu_calibration.cli.start:sdimu",
            "adaptive = sdimu_calibration.nodes.programs:adaptive",
            "calibration_node = sdimu_calibration.nodes.programs:calibration_node",
            "compensate_node = sdimu_calibration.nodes.programs:compensate_node",
            "recorder_node = sdimu_calibration.nodes.programs:recorder_node",
            "replay_node = sdimu_calibration.nodes.programs:replay_node",
            "table_goals = sdimu_calibration.nodes.programs:table_goals",
        ]
    },
)
