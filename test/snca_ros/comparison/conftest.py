"""The output of one study, for the tests that read it."""

import pytest
from support.made_up_results import paper_rows, write_results

from snca_ros import cli


@pytest.fixture(scope='session')
def drawn(tmp_path_factory):
    """Return the output folder of a study of 3 shapes × 3 types × 4 seeds."""
    folder = tmp_path_factory.mktemp('drawn')
    results = write_results(folder / 'results', paper_rows(4))
    assert cli.main(['study', str(results)]) == 0
    return results / 'study'
