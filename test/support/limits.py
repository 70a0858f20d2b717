"""The only limit on wall time in tests, which guards against hanging.

What takes seconds on an idle machine takes minutes beside busy processes, so the limit is far above
all that a test needs. What is promised in seconds is measured in `benchmarks/`, not tested.
"""

import os

LIMIT = float(os.environ.get('SNCA_TEST_LIMIT', '600'))
"""Time [s] after which a test calls a wait a hang."""


def be_patient() -> None:
    """Give the graphs that this process and its forks describe and end that limit, too.

    A simulation waits for its voxels as long, unless a test says otherwise.
    """
    from snca_ros.graph import description, processes

    describe = description.describe_graph

    def describe_patient(*arguments: object) -> description.Graph:
        graph = describe(*arguments)
        if graph.simulation:
            given = graph.simulation.parameters[graph.simulation.name]
            graph.simulation.parameters[graph.simulation.name] = {
                'silence_limit': LIMIT, 'start_limit': LIMIT, **given
            }
        return graph

    description.describe_graph = describe_patient
    processes._PATIENCE = LIMIT
