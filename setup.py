"""Installs snca_ros for `pip install .` and for `colcon build` alike."""

import re
from pathlib import Path

from setuptools import find_packages, setup

PACKAGE = 'snca_ros'
EXECUTABLES = (
    'sim_node', 'voxel_node', 'recorder_node',
    'evolve', 'history', 'walk', 'voxels', 'policy', 'campaign', 'study', 'assess', 'bodies',
    'report', 'replay', 'render', 'firmware',
)

ROS = ['ros-jazzy-rclpy[fastrtps]', 'ros-jazzy-common-interfaces']
CLUSTER = ['distributed']
CMA = ['cma', 'threadpoolctl']
BODIES = ['ribs>=0.7.1,<0.13']
VIDEO = ['imageio-ffmpeg']
TEST = [
    *CLUSTER, *CMA, *BODIES, *VIDEO,
    'pytest', 'pytest-xdist', 'hypothesis', 'playwright', 'lxml', 'ruff', 'mypy',
    'types-PyYAML', 'wheel',
]


def launchers() -> list[str]:
    """Write the programs that `ros2 run` finds in lib/snca_ros, one per executable."""
    folder = Path('build') / 'launchers'
    folder.mkdir(parents=True, exist_ok=True)
    text = Path('scripts/launcher.sh').read_text()
    for name in EXECUTABLES:
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    return [str(folder / name) for name in EXECUTABLES]


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """Return the data files of a folder and its sub-folders, for share/snca_ros."""
    files: dict[str, list[str]] = {}
    for path in sorted(p for p in Path(folder).rglob('*') if p.is_file()):
        files.setdefault(f'share/{PACKAGE}/{path.parent}', []).append(str(path))
    return list(files.items())


source = Path('snca_ros/__init__.py').read_text()
(version,) = re.findall(r"^__version__ = '(.+)'", source, re.MULTILINE)

setup(
    name=PACKAGE,
    version=version,
    description='Modular soft robots with embodied spiking neural cellular automata, on ROS 2',
    long_description=Path('README.md').read_text(),
    long_description_content_type='text/markdown',
    author='The snca_ros developers',
    maintainer='The snca_ros developers',
    maintainer_email='maintainers@snca-ros.example',
    license='Apache-2.0',
    packages=find_packages(include=['sim_node', 'sim_node.*', 'snca_ros', 'snca_ros.*']),
    package_data={
        'sim_node': ['py.typed'],
        'snca_ros': [
            'py.typed', 'web/static/*', 'web/static/uplot/*', 'firmware/c/*', 'firmware/c/boards/*',
        ],
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{PACKAGE}']),
        (f'share/{PACKAGE}', ['package.xml']),
        (f'lib/{PACKAGE}', launchers()),
        *shared('launch'),
        *shared('config'),
    ],
    python_requires='>=3.10',
    install_requires=[
        # Lower bounds are tested by `make oldest`; upper ones keep off what has not been tried.
        'numpy>=1.26.4,<3', 'numba>=0.60,<0.69', 'pymunk>=7,<8', 'rosbags>=0.11.4,<0.12',
        'mcap>=1.1.1,<2', 'scipy>=1.11.4', 'matplotlib>=3.6.3,<4', 'pyyaml>=6', 'pillow>=10',
        'shtab>=1.6', 'websockets>=13',
    ],
    extras_require={
        'ros': ROS, 'test': TEST, 'cluster': CLUSTER, 'cma': CMA, 'bodies': BODIES, 'video': VIDEO,
    },
    entry_points={'console_scripts': ['snca = snca_ros.__main__:main']},
    zip_safe=False,
)
