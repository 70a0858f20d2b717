"""All declared dataclasses, of both packages: no value out of its range passes a constructor."""

import ast
import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.paths import ROOT

from sim_node.errors import InvalidInput
from sim_node.model.body_faults import FaultsOfBody
from sim_node.model.constants import declared, value_of
from sim_node.model.material import Material
from sim_node.model.solver import Solver
from sim_node.ros.sim_interface import BodyOptions, RunOptions
from sim_node.simulation import Simulation
from snca_ros.assessment.trials import AssessmentOptions
from snca_ros.bodies.settings import SearchSettings
from snca_ros.commands.firmware import FirmwareOptions
from snca_ros.commands.render import RenderOptions
from snca_ros.commands.replay import ReplayOptions
from snca_ros.commands.worker_options import WorkerOptions
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode_set import EpisodeSet
from snca_ros.faults import FAULTS_OF_CELLS, Faults, FaultsOfCells
from snca_ros.graph.description import WalkOptions
from snca_ros.nodes.interfaces import NeighborNames, RecorderOptions, ViewOptions, VoxelOptions

INSTANCES = {type(instance).__name__: instance for instance in (
    Material(), Solver(), FaultsOfBody(), FaultsOfCells(), Faults(), RunConfig.named(),
    AssessmentOptions(), BodyOptions(), RunOptions(), VoxelOptions(), NeighborNames(),
    RecorderOptions(), ViewOptions(), WalkOptions(), RenderOptions(), ReplayOptions(),
    WorkerOptions(), FirmwareOptions(), SearchSettings(), EpisodeSet(),
)}
DECLARATIONS = {'constant', 'choice', 'flag', 'text_value', 'same_as'}
FIELDS = [(name, f) for name, instance in INSTANCES.items() for f in declared(instance)]
NUMBERS = [(name, f) for name, f in FIELDS if 'low' in f.metadata]


def names(fields):
    return [f'{name}.{f.name}' for name, f in fields]


def declaring_classes():
    """Return the names of all classes in the source that declare a field."""
    found = set()
    for path in (p for package in ('sim_node', 'snca_ros') for p in (ROOT / package).rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef) and any(
                isinstance(line, ast.AnnAssign) and isinstance(line.value, ast.Call)
                and getattr(line.value.func, 'id', '') in DECLARATIONS for line in node.body
            ):
                found.add(node.name)
    return found


def test_every_declaring_class_is_tested_here():
    inherits = {'Faults'}
    assert declaring_classes() == set(INSTANCES) - inherits


@pytest.mark.parametrize(('name', 'f'), NUMBERS, ids=names(NUMBERS))
@given(data=st.data())
def test_no_number_out_of_its_range_passes_the_constructor(name, f, data):
    low, high = f.metadata['low'], f.metadata['high']
    if isinstance(f.default, int):
        beyond = st.integers(max_value=low - 1) | st.integers(min_value=high + 1) | st.floats()
    else:
        beyond = (
            st.floats(max_value=math.nextafter(low, -math.inf))
            | st.floats(min_value=math.nextafter(high, math.inf)) | st.just(math.nan)
        )
    other = st.booleans() | st.none() | st.text() | st.lists(st.integers())
    with pytest.raises(InvalidInput, match=rf'(^|\.){f.name}: got .* from ') as caught:
        replace(INSTANCES[name], **{f.name: data.draw(beyond | other)})
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('name', 'f'), FIELDS, ids=names(FIELDS))
@given(value=st.none() | st.binary() | st.integers(max_value=-10) | st.lists(st.text()))
def test_nothing_of_another_kind_passes_the_constructor(name, f, value):
    with pytest.raises(InvalidInput, match=rf'(^|\.){f.name}: got '):
        replace(INSTANCES[name], **{f.name: value})


@pytest.mark.parametrize(('name', 'f'), FIELDS, ids=names(FIELDS))
def test_every_default_is_what_its_field_declares(name, f):
    assert f.metadata['text']
    replace(INSTANCES[name], **{f.name: f.default})
    if 'read' not in f.metadata and isinstance(f.default, (float, str)):
        assert value_of(f.name, str(f.default), f) == f.default


def test_faults_are_declared_once():
    """Those of the body serve the simulation; those of the cells, with the seed, the voxels."""
    fields = {f.name: f for f in declared(Faults)}
    for part in (FaultsOfBody, FaultsOfCells):
        for f in declared(part):
            assert fields[f.name].metadata == f.metadata
    assert set(Faults().of_body) | set(Faults().of_cells) == set(fields)
    assert set(Faults().of_body) & set(Faults().of_cells) == {'seed'}
    assert tuple(Faults().of_cells) == FAULTS_OF_CELLS


@pytest.mark.parametrize('f', declared(FaultsOfBody), ids=lambda f: f.name)
def test_a_simulation_has_the_defaults_and_ranges_of_the_faults(f):
    Simulation('1', **{f.name: f.default})
    beyond = f.metadata['high'] + 1 if 'high' in f.metadata else 'nonsense'
    with pytest.raises(InvalidInput) as of_faults:
        Faults(**{f.name: beyond})
    with pytest.raises(InvalidInput) as of_simulation:
        Simulation('1', **{f.name: beyond})
    assert str(of_simulation.value) == str(of_faults.value)
