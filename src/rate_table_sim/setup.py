"""Package the rate_table_sim ROS 2 package; the entry points are the nodes and the command-line verbs."""

from setuptools import find_packages, setup

NAME = "rate_table_sim"

setup(
    name=NAME,
    version="0.1.0",
    description="Simulated three-axis rate table",
    license="Apache-2.0",
    packages=find_packages(),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
    ],
    zip_safe=False,
    entry_points={
        "console_scripts": ["rate_table_node = rate_table_sim.nodes.rate_table_node:main"],
    },
)
