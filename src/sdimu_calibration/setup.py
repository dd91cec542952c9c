"""Package the sdimu_calibration ROS 2 package; the entry points are the nodes and the command-line verbs."""

from setuptools import find_packages, setup

NAME = "sdimu_calibration"

setup(
    name=NAME,
    version="0.1.0",
    description="Navigation-level calibration of a strapdown IMU on a rate table",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "sdimu = sdimu_calibration.cli.main:main",
            "calibration_node = sdimu_calibration.nodes.calibration_node:main",
            "compensate_node = sdimu_calibration.nodes.compensate_node:main",
            "recorder_node = sdimu_calibration.nodes.recorder_node:main",
            "replay_node = sdimu_calibration.nodes.replay_node:main",
        ],
    },
)
