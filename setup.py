"""Package set-up for colcon (ament_python) and for pip; constraints.txt pins what is left open here."""

from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NAME = "sand_sim"
SHARE = f"share/{NAME}"
RERUN = "rerun-sdk==0.41.0"  # needs NumPy 2

setup(
    name=NAME,
    version="0.1.0",
    description="Robots digging and scooping sand, grain by grain, on any CPU or a GPU, driven by ROS 2 topics",
    long_description=Path(__file__).resolve().with_name("README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    license="Apache-2.0",
    license_files=["LICENSE"],
    python_requires=">=3.12,<3.13",
    packages=find_packages(include=["sand_sim*", "sampler*", "msg_adapters*"]),
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/config", glob("config/*.yaml") + glob("config/*.csv")),
        (f"{SHARE}/config/ros", glob("config/ros/*")),
        (f"{SHARE}/config/meshes", glob("config/meshes/*.stl")),
        (f"{SHARE}/launch", glob("launch/*.launch.py")),
    ],
    zip_safe=True,
    # The messages of an apt ROS are built for the system's NumPy 1.26, which must be allowed to stay.
    install_requires=["setuptools", "numpy>=1.26", "warp-lang==1.19.0", "trimesh==5.2.0", "pycollada==0.9.3", "PyYAML>=6.0.1"],
    extras_require={
        "recording": [RERUN],
        # Only for machines without an apt ROS, which these wheels would hide.
        "ros": [
            RERUN,
            "ros-jazzy-rclpy==7.1.6",
            "ros-jazzy-common-interfaces==5.3.6",
            "ros-jazzy-rmw-fastrtps-cpp==8.4.3",
        ],
        "figures": ["matplotlib==3.11.2"],
        "test": [
            "pytest==9.2.0",
            "pytest-xdist==3.8.0",
            "hypothesis==6.170.15",
            "ruff==0.17.6",
            # A DDS implementation that is not the node's own; there are no wheels for other processors.
            "cyclonedds==11.0.1; sys_platform == 'linux' and platform_machine == 'x86_64'",
        ],
    },
    entry_points={
        "console_scripts": [
            "sand_sim = sand_sim.cli.main:main",
            "sand_sim_node = sand_sim.node.main:main",
        ],
    },
)
