"""Compiled functions that are selected by the class of a named tuple."""

import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from support.limits import LIMIT

from sim_node.numerics.dispatch import method
from sim_node.numerics.jit import compiled, compiled_inline
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lanes import load, store


class Line(NamedTuple):
    slope: float
    start: float

    @staticmethod
    @compiled_inline
    def value(curve, x):
        return curve.slope * x + curve.start


class Square(NamedTuple):
    scale: float

    @staticmethod
    @compiled_inline
    def value(curve, x):
        return curve.scale * (x * x)


value_of = method('value', 'Return the value of a curve.')


@compiled
def values(curve, x, out):
    for i in range(x.shape[0]):
        store(out, i, 0, value_of(curve, load(x, i, 0)))


@pytest.mark.parametrize('width', [1, 4])
def test_the_method_of_the_class_is_called(width):
    x, out = zeros((3, 1), width), zeros((3, 1), width)
    x['lane'][:] = np.arange(3.0 * width).reshape(3, 1, width)
    for curve in (Line(2.0, 1.0), Square(0.5), Line(3.0, 0.0)):
        values(curve, x, out)
        np.testing.assert_array_equal(out['lane'], value_of(curve, x['lane']))


PROGRAM = """
import numpy as np
from curves import Cube
from sim_node.numerics.dispatch import method
from kernels import values, zeros
x, out = zeros((1, 1), 1), zeros((1, 1), 1)
x['lane'][:] = 3.0
values(Cube(1.0), x, out)
print(float(out['lane'][0, 0, 0]), sum(values.stats.cache_hits.values()))
"""

CURVES = """
from typing import NamedTuple
from sim_node.numerics.jit import compiled_inline

class Cube(NamedTuple):
    scale: float

    @staticmethod
    @compiled_inline
    def value(curve, x):
        return x * x * x
"""

KERNELS = """
from sim_node.numerics.dispatch import method
from sim_node.numerics.jit import compiled
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lanes import load, store
value_of = method('value', 'Return the value of a curve.')

@compiled
def values(curve, x, out):
    for i in range(x.shape[0]):
        store(out, i, 0, value_of(curve, load(x, i, 0)))
"""


def run(folder: Path) -> list[str]:
    path = os.pathsep.join([str(folder), *(p for p in sys.path if p)])
    environment = {**os.environ, 'PYTHONPATH': path, 'NUMBA_CACHE_DIR': str(folder / 'cache')}
    result = subprocess.run(
        [sys.executable, str(folder / 'program.py')], capture_output=True, text=True, timeout=LIMIT,
        env=environment, check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout.split()


def test_cached_code_is_reused_until_the_module_of_the_class_changes(tmp_path):
    for name, text in (('program', PROGRAM), ('curves', CURVES), ('kernels', KERNELS)):
        (tmp_path / f'{name}.py').write_text(text)
    assert run(tmp_path) == ['27.0', '0']
    assert run(tmp_path) == ['27.0', '1']
    (tmp_path / 'curves.py').write_text(CURVES.replace('x * x * x', '-(x * x * x)'))
    assert run(tmp_path) == ['-27.0', '0']


def test_cached_code_for_one_class_does_not_need_the_module_of_another(tmp_path):
    own = PROGRAM.replace('from curves import Cube', 'from lines import Cube')
    for name, text in (('curves', CURVES), ('lines', CURVES), ('kernels', KERNELS)):
        (tmp_path / f'{name}.py').write_text(text)
    for text, hits in ((PROGRAM, '0'), (own, '0'), (own, '1')):
        (tmp_path / 'program.py').write_text(text)
        assert run(tmp_path) == ['27.0', hits]
        if text == own:
            (tmp_path / 'curves.py').unlink(missing_ok=True)


def test_a_function_without_a_source_file_is_compiled(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict = {'__name__': 'notebook'}
    exec(compile(CURVES, 'cell-1.py', 'exec'), names)
    x, out = zeros((1, 1), 1), zeros((1, 1), 1)
    x['lane'][:] = 3.0
    values(names['Cube'](1.0), x, out)
    assert out['lane'][0, 0, 0] == 27.0


def test_code_for_a_class_of_the_main_program_is_not_cached(tmp_path):
    text = PROGRAM.replace('from curves import Cube', CURVES)
    for name, source in (('program', text), ('kernels', KERNELS)):
        (tmp_path / f'{name}.py').write_text(source)
    assert run(tmp_path) == run(tmp_path) == ['27.0', '0']
