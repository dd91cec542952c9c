"""Package the studies: verbs of `sdimu` that need a clone's tools for many runs; no ROS package."""

from setuptools import find_packages, setup

NAME = "sdimu_study"
VERSION = "0.1.0"

setup(
    name=NAME,
    version=VERSION,
    description="Claims of the calibration put to the test, by many simulated tests",
    maintainer="sdimu-calibration maintainers",
    maintainer_email="maintainers@sdimu-calibration.org",
    license="Apache-2.0",
    license_files=["LICENSE"],
    platforms=["Linux x86_64"],
    python_requires=">=3.11",
    packages=find_packages(),
    package_data={NAME: ["py.typed", "heads/*.md"]},
    install_requires=[
        "dask",
        "distributed",
        "matplotlib",
        "numpy>=2.0",
        "plotly",
        "rich",
        "scipy",
        "typer",
        *(f"{name}=={VERSION}" for name in ("rate_table_sim", "sdimu_calibration", "sdimu_sim")),
    ],
    zip_safe=False,
    entry_points={
        "sdimu_calibration.verbs": [
            "monte-carlo = sdimu_study.cli.monte_carlo:monte_carlo",
            "hidden-campaign = sdimu_study.cli.hidden_campaign:hidden_campaign",
            "study = sdimu_study.cli.study:app",
            "bench = sdimu_study.cli.bench:bench",
        ]
    },
)
