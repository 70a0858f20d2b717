"""Runs all benchmarks: offline episodes, both engines, lanes, evolution, graphs of ROS nodes.

python -m benchmarks [--quick] [--json FILE]
"""

from benchmarks import batched, evolution, graph, lane_loops, offline, real_time
from benchmarks.command import run_all

if __name__ == '__main__':
    run_all(__doc__, {
        'offline': (offline.measure, offline.table),
        'batched': (batched.measure, batched.table),
        'lane loops': (lane_loops.measure, lane_loops.table),
        'evolution': (evolution.measure, evolution.table),
        'graph': (graph.measure, graph.table),
        'real time': (real_time.measure, real_time.table),
    })
