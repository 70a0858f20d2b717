"""What pip and colcon install: the wheel, the sdist, and the files that have to agree on it."""

import re
import shutil
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ET
import zipfile

import pytest
import yaml
from support.paths import ROOT

import snca_ros
from snca_ros import cli

PACKAGE = ET.parse(ROOT / 'package.xml').getroot()
PARTS = (
    'benchmarks', 'config', 'docs', 'launch', 'resource', 'results', 'scripts', 'sim_node',
    'snca_ros', 'test',
)


def test_versions_agree():
    citation = yaml.safe_load((ROOT / 'CITATION.cff').read_text())
    assert PACKAGE.findtext('version') == citation['version'] == snca_ros.__version__
    assert PACKAGE.findtext('license') == citation['license']


@pytest.fixture(scope='module')
def built(tmp_path_factory):
    """Build a copy of the checkout; return the names in the wheel and the sdist, and metadata."""
    if not (ROOT / 'setup.py').exists():
        pytest.skip('an installed package has nothing to build')
    pytest.importorskip('wheel')
    copy = tmp_path_factory.mktemp('checkout')
    for path in ROOT.iterdir():
        if path.is_file():
            shutil.copy(path, copy)
        elif path.name in PARTS:
            ignored = shutil.ignore_patterns('__pycache__')
            shutil.copytree(path, copy / path.name, ignore=ignored)
    subprocess.run(
        [sys.executable, 'setup.py', '-q', 'sdist', 'bdist_wheel'],
        cwd=copy, check=True, capture_output=True,
    )
    (wheel,), (sdist,) = (copy / 'dist').glob('*.whl'), (copy / 'dist').glob('*.tar.gz')
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        info = f'snca_ros-{snca_ros.__version__}.dist-info'
        metadata = archive.read(f'{info}/METADATA').decode()
    with tarfile.open(sdist) as archive:
        sources = [name.partition('/')[2] for name in archive.getnames()]
    return names, sources, metadata


def files_in(*folders):
    paths = [path for folder in folders for path in (ROOT / folder).rglob('*') if path.is_file()]
    return {str(p.relative_to(ROOT)) for p in paths if '__pycache__' not in p.parts}


def test_wheel_has_all_modules_all_that_nodes_load_and_nothing_else(built):
    names, _, _ = built
    prefix = f'snca_ros-{snca_ros.__version__}'
    modules = {name for name in files_in('sim_node', 'snca_ros')}
    shared = {f'{prefix}.data/data/share/snca_ros/{n}' for n in files_in('config', 'launch')}
    executables = (*cli.COMMANDS, *cli.NODES)
    launchers = {
        f'{prefix}.data/data/lib/snca_ros/{n}' for n in executables if n != 'completion'
    }
    marker = f'{prefix}.data/data/share/ament_index/resource_index/packages/snca_ros'
    manifest = f'{prefix}.data/data/share/snca_ros/package.xml'
    found = {name for name in names if f'{prefix}.dist-info/' not in name}
    assert found == modules | shared | launchers | {marker, manifest}


def test_sdist_has_what_builds_tests_and_explains(built):
    _, sources, _ = built
    wanted = files_in('sim_node', 'snca_ros', 'config', 'launch', 'docs', 'scripts', 'resource')
    wanted |= files_in('test', 'benchmarks')
    wanted |= {path.name for path in ROOT.glob('*.md')}
    wanted |= {'package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml', 'Makefile', 'LICENSE',
               'CHANGELOG.rst', 'CITATION.cff'}
    assert wanted <= set(sources)


def test_package_xml_names_what_pip_installs(built):
    _, _, metadata = built
    required = re.findall(r'^Requires-Dist: ([a-z]+)(?!.*extra ==)', metadata, re.MULTILINE)
    assert 'numba' in required
    told = {e.text.removeprefix('python3-') for e in PACKAGE.iter('exec_depend')}
    told |= set(re.findall(r'[a-z]+', (ROOT / 'package.xml').read_text().partition('<!--')[2]))
    rosdep = {'pyyaml': 'yaml', 'pillow': 'pil'}
    assert {rosdep.get(name, name) for name in required} <= told


def test_package_xml_names_the_ros_packages_that_are_imported():
    folders = ('sim_node', 'snca_ros', 'launch')
    text = '\n'.join(p.read_text() for f in folders for p in (ROOT / f).rglob('*.py'))
    ros = r'^\s*(?:from|import) (rclpy|launch|launch_ros|\w+_(?:msgs|srvs|interfaces))\b'
    imported = set(re.findall(ros, text, re.MULTILINE))
    assert {'rclpy', 'launch_ros', 'rcl_interfaces', 'sensor_msgs'} <= imported
    assert imported <= {e.text for e in PACKAGE.iter('exec_depend')}


def test_changelog_has_a_title_and_sections_by_rep_132():
    lines = (ROOT / 'CHANGELOG.rst').read_text().splitlines()
    title = 'Changelog for package snca_ros'
    assert lines[:3] == ['^' * len(lines[0]), title, '^' * len(lines[0])]
    assert len(lines[0]) >= len(title)
    below = zip(lines[3:], lines[4:], strict=False)
    sections = [head for head, line in below if line and set(line) == {'-'}]
    assert sections
    for section in sections:
        assert re.fullmatch(r'Forthcoming|\d+\.\d+\.\d+ \(\d{4}-\d\d-\d\d\)', section)
