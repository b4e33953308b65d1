# Copyright 2026 Virtual rig maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build description of rig_nodes, for colcon (ament_python) and for pip alike."""

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "rig_nodes"
VERSION = re.search("<version>(.+?)</version>", Path("package.xml").read_text(encoding="utf-8")).group(1)


def share_files(folder: str, into: str, pattern: str) -> list[tuple[str, list[str]]]:
    """data_files entries that put `folder` below share/rig_nodes/<into>, one entry for each folder in it."""
    entries: dict[str, list[str]] = {}
    for path in sorted(Path(folder).rglob(pattern)):
        target = Path("share", NAME, into, path.parent.relative_to(folder))
        entries.setdefault(target.as_posix(), []).append(path.as_posix())
    return list(entries.items())


EXTRAS = {
    "ros": ["ros-jazzy-rclpy[fastrtps]", "ros-common-interfaces"],
    "view": ["rerun-sdk"],
    "panel": ["tornado"],
    "plugs": ["python-can", "cantools", "pymodbus"],
    "mdf": ["asammdf", "openpyxl", "npTDMS", "h5py"],
    "learn": ["gymnasium"],
    "sweep": ["dask", "distributed", "optuna"],
    "docs": ["sphinx", "myst-parser", "furo", "sphinx-copybutton"],
    "test": ["pytest", "mcap-ros2-support", "can-j1939"],
}

setup(
    name=NAME,
    version=VERSION,
    description="A virtual powertrain test rig as ROS 2 nodes",
    license="Apache-2.0",
    maintainer="Virtual rig maintainers",
    maintainer_email="rig@example.invalid",
    packages=find_packages(include=[NAME, NAME + ".*"]),
    package_data={
        NAME: [
            "base/**/*.yaml",
            "base/*.xml",
            "bags/interfaces/*/msg/*.msg",
            "view/templates/*.html",
            "nodes/panel/static/*",
            "py.typed",
            "rigs/**/*.yaml",
            "rigs/**/*.csv",
            "rigs/**/*.py",
            "rigs/**/*.svg",
            "rig/template/**/*.yaml",
            "*/__init__.pyi",
            "controllers/include/*.h*",
            "controllers/examples/**/*.c*",
            "controllers/examples/**/*.h",
            "controllers/examples/**/*.xml",
            "controllers/examples/**/CMakeLists.txt",
            "controllers/templates/**/*",
            "runs/fmu/c/*",
        ]
    },
    exclude_package_data={NAME: ["**/*.pyc"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml"]),
        *share_files(NAME + "/base", "config", "*.yaml"),
        *share_files(NAME + "/rigs", "rigs", "*.yaml"),
        *share_files(NAME + "/rigs", "rigs", "*.csv"),
        *share_files(NAME + "/base", "config", "*.xml"),
        *share_files("launch", "launch", "*.py"),
    ],
    python_requires=">=3.11",
    install_requires=[
        "setuptools",
        "numpy>=1.26",
        "scipy",
        "numba",
        "mcap",
        "lz4",
        "zstandard",
        "rosbags",
        "ruamel.yaml",
        "tqdm",
        "lazy-loader",
        "pandas",
        "pyarrow",
        "matplotlib",
        "jinja2",
        "cmaes",
        "fmpy<0.3.26",
    ],
    # rig_msgs is not among them: it is built for ROS 2 from msgs/, by colcon or by the launcher of a checkout.
    extras_require={**EXTRAS, "all": sorted({name for names in EXTRAS.values() for name in names})},
    zip_safe=False,
    entry_points={
        "console_scripts": [
            "rig = rig_nodes.cli.main:main",
            "replay = rig_nodes.cli.replay:node",
            "rig_container = rig_nodes.nodes.rig_container:main",
            "alfa46 = rig_nodes.nodes.alfa46:main",
            "sequencer = rig_nodes.nodes.sequencer:main",
            "recorder = rig_nodes.nodes.recorder:main",
            "device = rig_nodes.nodes.cut_device:main",
        ],
        "pytest11": ["rig_nodes = rig_nodes.api.pytest_plugin"],
    },
)
